# type: ignore
# (device code, which Warp's stubs do not type)
"""Projection of Gaussians to splats on the image, one thread per Gaussian.

The notation is that of `digs_warp.splat.footprint`. The determinant of the covariance is taken as
|m0 x m1|^2 + dilation (|m0|^2 + |m1|^2) + dilation^2 (Cauchy-Binet): a sum of squares, so that a needle of
any length keeps a positive one in float32. Its first term is the determinant before the dilation: with
antialiasing, the opacity is scaled by the square root of its share (Mip-Splatting, section 4.2).
"""

import warp as wp

from digs_warp.splat.config import (
    EXTENT_SLACK,
    MAX_COLOR,
    MAX_VARIANCE,
    MIN_COMPENSATION,
    TILE_SIZE,
)
from digs_warp.splat.footprint import ViewParams, facing_normal, footprint_of
from digs_warp.splat.records import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_BLUE,
    SPLAT_C,
    SPLAT_CHORD,
    SPLAT_GREEN,
    SPLAT_HALF_HEIGHT,
    SPLAT_HALF_WIDTH,
    SPLAT_OPACITY,
    SPLAT_PEAK,
    SPLAT_RED,
    SPLAT_SLOPE,
    SPLAT_TAPER,
    SPLAT_TAU,
    SPLAT_U,
    SPLAT_V,
)
from digs_warp.splat.shade import sh_color

wp.set_module_options({"enable_backward": False})

_TILE = wp.constant(TILE_SIZE)
_SLACK = wp.constant(EXTENT_SLACK)
_MAX_VARIANCE = wp.constant(MAX_VARIANCE)
_MAX_COLOR = wp.constant(MAX_COLOR)
_MIN_COMPENSATION = wp.constant(MIN_COMPENSATION)
# Where the chord of an ellipse ends, its square is a small difference of large numbers.
_ROUNDING = wp.constant(1.0 + 2e-5)


@wp.func
def sigmoid(logit: float) -> float:
    """Opacity of a logit."""
    return 1.0 / (1.0 + wp.exp(-logit))


@wp.func
def compensation(det_before: float, det: float) -> float:
    """Antialiasing factor of the opacity, sqrt(det before / det after the dilation)."""
    return wp.max(wp.sqrt(det_before / det), _MIN_COMPENSATION)


@wp.kernel
def project_kernel(
    first: int,
    views: wp.array[ViewParams],  # [1]
    means: wp.array[wp.vec3],  # [n] world
    log_scales: wp.array[wp.vec3],  # [n]
    quats: wp.array[wp.vec4],  # [n] xyzw, raw
    opacity_logits: wp.array[float],  # [n]
    coefficients: wp.array2d[wp.vec3],  # [n, K]
    degree: int,
    # outputs
    splats: wp.array2d[float],  # [n, SPLAT_FIELDS]
    depths: wp.array[float],  # [n] planar depth [m]
    first_tile_rows: wp.array[int],  # [n]
    row_counts: wp.array[int],  # [n] tile rows that the splat touches, 0 if it is not drawn
    normals: wp.array[wp.vec3],  # [n] in the camera, facing it; empty: not wanted
):
    """Project Gaussians; one that is not drawn gets ``row_counts`` 0 and nothing else."""
    g = first + wp.tid()
    row_counts[g] = 0
    depths[g] = 0.0
    cam = views[0]
    z = (cam.rotation * means[g] + cam.translation)[2]
    opacity = sigmoid(opacity_logits[g])
    # Written so that NaN anywhere ends here, too.
    if not (z > cam.near and z < _MAX_VARIANCE and opacity > cam.min_alpha):
        return
    f = footprint_of(cam, means[g], log_scales[g], quats[g])
    aa = wp.dot(f.m0, f.m0)
    cc = wp.dot(f.m1, f.m1)
    if not (aa < _MAX_VARIANCE and cc < _MAX_VARIANCE):
        return
    b = wp.dot(f.m0, f.m1)
    cross = wp.cross(f.m0, f.m1)
    det_before = wp.dot(cross, cross)
    det = det_before + cam.dilation * (aa + cc) + cam.dilation * cam.dilation
    if cam.antialias != 0:
        opacity *= compensation(det_before, det)
        if not opacity > cam.min_alpha:
            return
    tau = 2.0 * wp.log(opacity / cam.min_alpha)
    half_width = wp.sqrt(tau * (aa + cam.dilation)) + _SLACK
    half_height = wp.sqrt(tau * (cc + cam.dilation)) + _SLACK
    pu = cam.fx * f.tangent_x + cam.cx
    pv = cam.fy * f.tangent_y + cam.cy
    # The drawn tiles, cut off at the image.
    left = float(cam.first_column * _TILE) + 0.5
    right = float(wp.min(cam.end_column * _TILE, cam.width)) - 0.5
    upper = float(cam.first_row * _TILE) + 0.5
    lower = float(wp.min(cam.end_row * _TILE, cam.height)) - 0.5
    if not (pu + half_width > left and pu - half_width < right):
        return
    if not (pv + half_height > upper and pv - half_height < lower):
        return
    # Clamped as floats: a huge splat would overflow an integer.
    top = int(wp.max(wp.ceil(pv - half_height - 0.5), upper - 0.5))
    bottom = int(wp.min(wp.floor(pv + half_height - 0.5), lower - 0.5))
    if top > bottom:
        return
    # Coefficients that cancel in the colour would still overflow in the gradient.
    size = float(0.0)
    for k in range((degree + 1) * (degree + 1)):
        size = size + wp.dot(wp.abs(coefficients[g, k]), wp.vec3(1.0, 1.0, 1.0))
    if not size < _MAX_COLOR:
        return
    color = sh_color(coefficients, g, degree, wp.normalize(means[g] - cam.center_world))
    splats[g, SPLAT_U] = pu
    splats[g, SPLAT_V] = pv
    splats[g, SPLAT_A] = (cc + cam.dilation) / det
    splats[g, SPLAT_B] = -b / det
    splats[g, SPLAT_C] = (aa + cam.dilation) / det
    splats[g, SPLAT_OPACITY] = opacity
    splats[g, SPLAT_RED] = wp.max(color[0], 0.0)
    splats[g, SPLAT_GREEN] = wp.max(color[1], 0.0)
    splats[g, SPLAT_BLUE] = wp.max(color[2], 0.0)
    splats[g, SPLAT_HALF_WIDTH] = half_width
    splats[g, SPLAT_HALF_HEIGHT] = half_height
    splats[g, SPLAT_TAU] = tau
    var_x = aa + cam.dilation
    splats[g, SPLAT_SLOPE] = b / var_x
    splats[g, SPLAT_CHORD] = _ROUNDING * tau * (det / var_x)
    splats[g, SPLAT_TAPER] = (det / var_x) / var_x
    splats[g, SPLAT_PEAK] = b * wp.sqrt(tau / (cc + cam.dilation))
    depths[g] = z
    first_tile_rows[g] = top // _TILE
    row_counts[g] = bottom // _TILE - top // _TILE + 1
    if normals.shape[0] > 0:
        normals[g] = facing_normal(f)
