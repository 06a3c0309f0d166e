# type: ignore
# (device code, which Warp's stubs do not type)
"""Projection of Gaussians to splats on the image, and its gradient, one thread per Gaussian.

The notation is that of `digs_warp.splat.footprint`. The determinant of the covariance is taken as
|m0 x m1|^2 + DILATION (|m0|^2 + |m1|^2) + DILATION^2 (Cauchy-Binet): a sum of squares, so that a needle of
any length keeps a positive one in float32.

The gradient is written by hand: it fuses the sum over a splat's tiles, the projection and the colour in
one pass, which Warp's generated adjoint cannot. Tests compare it with central differences of a float64
twin.
"""

import warp as wp

from digs_warp.splat.config import (
    DILATION,
    EXTENT_SLACK,
    MAX_VARIANCE,
    MIN_ALPHA,
)
from digs_warp.splat.footprint import CameraParams, footprint_of, rotation_adjoint
from digs_warp.splat.shade import sh_adjoint, sh_color

wp.set_module_options({"enable_backward": False})

# Columns of a splat's record: what a tile reads of a splat lies together.
SPLAT_U = wp.constant(0)
SPLAT_V = wp.constant(1)
SPLAT_A = wp.constant(2)
SPLAT_B = wp.constant(3)
SPLAT_C = wp.constant(4)
SPLAT_OPACITY = wp.constant(5)
SPLAT_RED = wp.constant(6)
SPLAT_GREEN = wp.constant(7)
SPLAT_BLUE = wp.constant(8)
SPLAT_HALF_WIDTH = wp.constant(9)  # half extents [px] of the area with alpha >= MIN_ALPHA
SPLAT_HALF_HEIGHT = wp.constant(10)
SPLAT_TAU = wp.constant(11)  # 2 ln(opacity / MIN_ALPHA): squared Mahalanobis radius of that area
SPLAT_FIELDS = 12

# Columns of the gradient record of one (tile, splat) pair: d/d u, v, A, B, C, opacity, red, green, blue.
GRADIENT_FIELDS = 9

_DILATION = wp.constant(DILATION)
_SLACK = wp.constant(EXTENT_SLACK)
_MAX_VARIANCE = wp.constant(MAX_VARIANCE)
_MIN_ALPHA = wp.constant(MIN_ALPHA)


@wp.func
def sigmoid(logit: float) -> float:
    """Opacity of a logit."""
    return 1.0 / (1.0 + wp.exp(-logit))


@wp.kernel
def project_kernel(
    first: int,
    cameras: wp.array[CameraParams],  # [1]
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
):
    """Project Gaussians; one that is not drawn gets ``row_counts`` 0 and nothing else."""
    g = first + wp.tid()
    row_counts[g] = 0
    depths[g] = 0.0
    cam = cameras[0]
    z = (cam.rotation * means[g] + cam.translation)[2]
    opacity = sigmoid(opacity_logits[g])
    # Written so that NaN anywhere ends here, too.
    if not (z > cam.near and opacity > _MIN_ALPHA):
        return
    f = footprint_of(cam, means[g], log_scales[g], quats[g])
    aa = wp.dot(f.m0, f.m0)
    cc = wp.dot(f.m1, f.m1)
    if not (aa < _MAX_VARIANCE and cc < _MAX_VARIANCE):
        return
    b = wp.dot(f.m0, f.m1)
    cross = wp.cross(f.m0, f.m1)
    det = wp.dot(cross, cross) + _DILATION * (aa + cc) + _DILATION * _DILATION
    tau = 2.0 * wp.log(opacity / _MIN_ALPHA)
    half_width = wp.sqrt(tau * (aa + _DILATION)) + _SLACK
    half_height = wp.sqrt(tau * (cc + _DILATION)) + _SLACK
    pu = cam.fx * f.tangent_x + cam.cx
    pv = cam.fy * f.tangent_y + cam.cy
    width = float(cam.width)
    height = float(cam.height)
    if not (pu + half_width > 0.5 and pu - half_width < width - 0.5):
        return
    if not (pv + half_height > 0.5 and pv - half_height < height - 0.5):
        return
    # Clamped as floats: a huge splat would overflow an integer.
    top = int(wp.max(wp.ceil(pv - half_height - 0.5), 0.0))
    bottom = int(wp.min(wp.floor(pv + half_height - 0.5), height - 1.0))
    if top > bottom:
        return
    color = sh_color(coefficients, g, degree, wp.normalize(means[g] - cam.center_world))
    if not (color[0] + color[1] + color[2] < 1.0e9):
        return
    splats[g, SPLAT_U] = pu
    splats[g, SPLAT_V] = pv
    splats[g, SPLAT_A] = (cc + _DILATION) / det
    splats[g, SPLAT_B] = -b / det
    splats[g, SPLAT_C] = (aa + _DILATION) / det
    splats[g, SPLAT_OPACITY] = opacity
    splats[g, SPLAT_RED] = wp.max(color[0], 0.0)
    splats[g, SPLAT_GREEN] = wp.max(color[1], 0.0)
    splats[g, SPLAT_BLUE] = wp.max(color[2], 0.0)
    splats[g, SPLAT_HALF_WIDTH] = half_width
    splats[g, SPLAT_HALF_HEIGHT] = half_height
    splats[g, SPLAT_TAU] = tau
    depths[g] = z
    first_tile_rows[g] = top // 16
    row_counts[g] = bottom // 16 - top // 16 + 1


@wp.kernel
def project_backward_kernel(
    first: int,
    cameras: wp.array[CameraParams],
    means: wp.array[wp.vec3],
    log_scales: wp.array[wp.vec3],
    quats: wp.array[wp.vec4],
    coefficients: wp.array2d[wp.vec3],
    degree: int,
    splats: wp.array2d[float],
    pair_starts: wp.array[int],  # [n + 1] pairs of splat g: pair_starts[g] .. pair_starts[g + 1]
    pair_slots: wp.array[int],  # [pairs] where the gradient record of a pair lies
    pair_gradients: wp.array2d[float],  # [pairs, GRADIENT_FIELDS]
    # outputs
    adj_means: wp.array[wp.vec3],
    adj_log_scales: wp.array[wp.vec3],
    adj_quats: wp.array[wp.vec4],
    adj_opacity_logits: wp.array[float],
    adj_coefficients: wp.array2d[wp.vec3],
):
    """Sum a splat's gradient over its tiles in a fixed order and pull it back to the parameters."""
    g = first + wp.tid()
    begin = pair_starts[g]
    end = pair_starts[g + 1]
    if begin == end:
        adj_means[g] = wp.vec3(0.0, 0.0, 0.0)
        adj_log_scales[g] = wp.vec3(0.0, 0.0, 0.0)
        adj_quats[g] = wp.vec4(0.0, 0.0, 0.0, 0.0)
        adj_opacity_logits[g] = 0.0
        for k in range(adj_coefficients.shape[1]):
            adj_coefficients[g, k] = wp.vec3(0.0, 0.0, 0.0)
        return

    du = float(0.0)
    dv = float(0.0)
    da = float(0.0)
    db = float(0.0)
    dc = float(0.0)
    d_opacity = float(0.0)
    d_color = wp.vec3(0.0, 0.0, 0.0)
    for pair in range(begin, end):
        slot = pair_slots[pair]
        du += pair_gradients[slot, 0]
        dv += pair_gradients[slot, 1]
        da += pair_gradients[slot, 2]
        db += pair_gradients[slot, 3]
        dc += pair_gradients[slot, 4]
        d_opacity += pair_gradients[slot, 5]
        d_color += wp.vec3(
            pair_gradients[slot, 6], pair_gradients[slot, 7], pair_gradients[slot, 8]
        )

    cam = cameras[0]
    f = footprint_of(cam, means[g], log_scales[g], quats[g])

    # conic -> covariance: G_cov = -Q G_Q Q with the symmetric G_Q = [[da, db/2], [db/2, dc]].
    qa = splats[g, SPLAT_A]
    qb = splats[g, SPLAT_B]
    qc = splats[g, SPLAT_C]
    h00 = da * qa + 0.5 * db * qb
    h01 = da * qb + 0.5 * db * qc
    h10 = 0.5 * db * qa + dc * qb
    h11 = 0.5 * db * qb + dc * qc
    g00 = -(qa * h00 + qb * h10)
    g01 = -(qa * h01 + qb * h11)
    g11 = -(qb * h01 + qc * h11)
    # covariance -> M: G_M = 2 G_cov M
    dm0 = 2.0 * (g00 * f.m0 + g01 * f.m1)
    dm1 = 2.0 * (g01 * f.m0 + g11 * f.m1)

    # M -> scales (M is linear in each), rotation
    d_log_scale = wp.cw_mul(dm0, f.m0) + wp.cw_mul(dm1, f.m1)
    adj_log_scales[g] = d_log_scale
    dv0 = f.zoom_x * wp.cw_mul(dm0, f.sizes)
    dv1 = f.zoom_y * wp.cw_mul(dm1, f.sizes)
    dv2 = -f.limited_x * dv0 - f.limited_y * dv1
    d_rotation = wp.transpose(cam.rotation) * wp.matrix_from_rows(dv0, dv1, dv2)
    adj_quats[g] = rotation_adjoint(quats[g], d_rotation)

    # centre: through the pixel position, the factor 1/z of M, and the tangents where not clamped
    dx = du * f.zoom_x
    dy = dv * f.zoom_y
    shrink = f.inverse_z * (d_log_scale[0] + d_log_scale[1] + d_log_scale[2])
    if f.limited_x == f.tangent_x:
        dx -= f.inverse_z * wp.dot(dv0, f.axes[2])
    if f.limited_y == f.tangent_y:
        dy -= f.inverse_z * wp.dot(dv1, f.axes[2])
    # x/z and y/z depend on z as on x and y, times minus the tangent.
    dz = -(dx * f.tangent_x + dy * f.tangent_y) - shrink
    d_mean = wp.transpose(cam.rotation) * wp.vec3(dx, dy, dz)

    # colour: no gradient where the clamp at 0 holds
    for channel in range(3):
        if splats[g, SPLAT_RED + channel] <= 0.0:
            d_color[channel] = 0.0
    offset = means[g] - cam.center_world
    distance = wp.length(offset)
    direction = offset / distance
    d_direction = sh_adjoint(coefficients, g, degree, direction, d_color, adj_coefficients)
    for k in range((degree + 1) * (degree + 1), adj_coefficients.shape[1]):
        adj_coefficients[g, k] = wp.vec3(0.0, 0.0, 0.0)
    d_mean += (d_direction - direction * wp.dot(direction, d_direction)) / distance
    adj_means[g] = d_mean

    opacity = splats[g, SPLAT_OPACITY]
    adj_opacity_logits[g] = d_opacity * opacity * (1.0 - opacity)
