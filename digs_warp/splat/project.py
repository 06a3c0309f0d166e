"""Projection of Gaussians to splats on the image, one by one and in groups.

The notation is that of `digs_warp.splat.footprint`. The determinant of the covariance is taken as
|m0 x m1|^2 + dilation (|m0|^2 + |m1|^2) + dilation^2 (Cauchy-Binet): a sum of squares, so that a needle of
any length keeps a positive one in float32. Its first term is the determinant before the dilation: with
antialiasing, the opacity is scaled by the square root of its share (Mip-Splatting, section 4.2).

A splat is a soft ball, and a surface is a layer of them, of which each hides a part. A photograph shows the
outside of that layer: splats that fit the photographs have their centers inside the object. In training
without a depth term, the true surface is found a number of standard deviations in front of the centers that
is nearly the same for all objects, whatever their opacity. So the depth of a splat can be that of its skin,

    skin = z (1 - REACH / |S^-1 V^T p|),   planar z; |p| / |S^-1 V^T p| is the deviation along the ray

A depth camera measures the skin: a training that pulls the centers there moves the silhouettes out. The order
of the splats stays that of their centers. The backward pass takes the distance to the skin as a constant, so
a gradient of the depth moves the centers, but does not change the scales through it.
"""

import warp as wp

from digs_warp.device.elementary import larger, log_of, sigmoid, smaller
from digs_warp.splat.config import (
    EXTENT_SLACK,
    MAX_COLOR,
    MAX_VARIANCE,
    MIN_ALPHA,
    MIN_COMPENSATION,
    TILE_SIZE,
)
from digs_warp.splat.footprint import ViewParams, footprint_of, spread_of
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
    GaussianArrays,
    Splats,
)
from digs_warp.splat.shade import sh_color

wp.set_module_options({"enable_backward": False})

_TILE = wp.constant(TILE_SIZE)
_SLACK = wp.constant(EXTENT_SLACK)
_MAX_VARIANCE = wp.constant(MAX_VARIANCE)
_MAX_COLOR = wp.constant(MAX_COLOR)
_MIN_ALPHA = wp.constant(MIN_ALPHA)
# A splat as wide as its distance has its skin at this share of the distance, not behind the camera.
_LEAST_SHARE = wp.constant(0.1)
_MIN_COMPENSATION = wp.constant(MIN_COMPENSATION)
# Where the chord of an ellipse ends, its square is a small difference of large numbers.
_ROUNDING = wp.constant(1.0 + 2e-5)


@wp.func
def compensation(det_before: float, det: float) -> float:
    """Antialiasing factor of the opacity, sqrt(det before / det after the dilation)."""
    return wp.max(wp.sqrt(det_before / det), _MIN_COMPENSATION)


@wp.struct
class Projection:
    """A Gaussian on the image but for its color: fields of `digs_warp.splat.records`, and where it lies."""

    drawn: int  # 0: nothing else of this means anything
    z: float  # planar depth of the center ...
    depth: float  # ... and what the view shows [m]
    u: float
    v: float
    a: float
    b: float
    c: float
    opacity: float
    half_width: float
    half_height: float
    tau: float
    slope: float
    chord: float
    taper: float
    peak: float
    box: wp.vec4i  # first tile column and row, and how many


@wp.func
def pixels_between(low: float, high: float, size: int) -> wp.vec2i:
    """The first and the last of ``size`` pixels whose centers lie between; the last is less if none does."""
    # Clamped as floats: a huge splat would overflow an integer.
    end = float(size)
    first = int(smaller(larger(wp.ceil(low - 0.5), 0.0), end))
    last = int(larger(smaller(wp.floor(high - 0.5), end - 1.0), -1.0))
    return wp.vec2i(first, last)


@wp.func
def projection_of(
    cam: ViewParams, mean: wp.vec3, log_scale: wp.vec3, quat: wp.vec4, opacity_logit: float
) -> Projection:
    """Project one Gaussian; straight-line code, so that several are done at once."""
    p = Projection()
    f = footprint_of(cam, mean, log_scale, quat)
    p.z = f.point[2]
    deviations = wp.length(wp.cw_div(wp.transpose(f.axes) * f.point, f.sizes))
    skin = p.z * larger(1.0 - cam.reach / deviations, _LEAST_SHARE)
    p.depth = wp.where(cam.reach > 0.0, skin, p.z)
    opacity = sigmoid(opacity_logit)
    s = spread_of(cam, f)
    opacity = wp.where(cam.antialias != 0, opacity * compensation(s.det_before, s.det), opacity)
    var_x = s.a + cam.dilation
    var_y = s.c + cam.dilation
    p.tau = 2.0 * log_of(opacity / _MIN_ALPHA)
    p.half_width = wp.sqrt(p.tau * var_x) + _SLACK
    p.half_height = wp.sqrt(p.tau * var_y) + _SLACK
    p.u = cam.fx * f.tangent_x + cam.cx
    p.v = cam.fy * f.tangent_y + cam.cy
    across = pixels_between(p.u - p.half_width, p.u + p.half_width, cam.width)
    down = pixels_between(p.v - p.half_height, p.v + p.half_height, cam.height)
    column = across[0] // _TILE
    row = down[0] // _TILE
    p.box = wp.vec4i(column, row, across[1] // _TILE - column + 1, down[1] // _TILE - row + 1)
    # Written so that NaN anywhere ends as not drawn, too.
    drawn = wp.where(p.z > cam.near, 1, 0)
    drawn &= wp.where(p.z < _MAX_VARIANCE, 1, 0)
    drawn &= wp.where(opacity > _MIN_ALPHA, 1, 0)
    drawn &= wp.where(s.a < _MAX_VARIANCE, 1, 0)
    drawn &= wp.where(s.c < _MAX_VARIANCE, 1, 0)
    drawn &= wp.where(p.half_width == p.half_width and p.u == p.u, 1, 0)
    drawn &= wp.where(p.half_height == p.half_height and p.v == p.v, 1, 0)
    drawn &= wp.where(across[0] <= across[1], 1, 0)
    p.drawn = drawn & wp.where(down[0] <= down[1], 1, 0)
    p.a = var_y / s.det
    p.b = -s.b / s.det
    p.c = var_x / s.det
    p.opacity = opacity
    p.slope = s.b / var_x
    p.chord = _ROUNDING * p.tau * (s.det / var_x)
    p.taper = (s.det / var_x) / var_x
    p.peak = s.b * wp.sqrt(p.tau / var_y)
    return p


@wp.func
def put_record(p: Projection, record: wp.array[float], first: int, step: int):
    """Write a splat's record but for its color: field k to ``record[first + k * step]``."""
    record[first + SPLAT_U * step] = p.u
    record[first + SPLAT_V * step] = p.v
    record[first + SPLAT_A * step] = p.a
    record[first + SPLAT_B * step] = p.b
    record[first + SPLAT_C * step] = p.c
    record[first + SPLAT_OPACITY * step] = p.opacity
    record[first + SPLAT_HALF_WIDTH * step] = p.half_width
    record[first + SPLAT_HALF_HEIGHT * step] = p.half_height
    record[first + SPLAT_TAU * step] = p.tau
    record[first + SPLAT_SLOPE * step] = p.slope
    record[first + SPLAT_CHORD * step] = p.chord
    record[first + SPLAT_TAPER * step] = p.taper
    record[first + SPLAT_PEAK * step] = p.peak


@wp.func
def color_is_finite(coefficients: wp.array2d[wp.vec3], g: int, degree: int) -> bool:
    """Whether the color is no overflow: what cancels in it would still be one in the gradient."""
    size = float(0.0)
    for k in range((degree + 1) * (degree + 1)):
        size = size + wp.dot(wp.abs(coefficients[g, k]), wp.vec3(1.0, 1.0, 1.0))
    return size < _MAX_COLOR


@wp.func
def put_color(
    cam: ViewParams,
    g: int,
    mean: wp.vec3,
    coefficients: wp.array2d[wp.vec3],
    degree: int,
    records: wp.array2d[float],
):
    """Write the color of a splat as this camera sees it."""
    direction = wp.vec3(0.0, 0.0, 0.0)
    if degree > 0:
        direction = wp.normalize(mean - cam.center_world)
    color = sh_color(coefficients, g, degree, direction)
    records[g, SPLAT_RED] = wp.max(color[0], 0.0)
    records[g, SPLAT_GREEN] = wp.max(color[1], 0.0)
    records[g, SPLAT_BLUE] = wp.max(color[2], 0.0)


@wp.kernel
def project_kernel(
    first: int,
    gaussians: GaussianArrays,
    degree: int,  # bands of the color
    splats: Splats,  # read: the view; written: all else
):
    """Project a Gaussian; one that is not drawn gets an empty box and nothing else."""
    g = first + wp.tid()
    splats.boxes[g] = wp.vec4i(0, 0, 0, 0)
    splats.centers[g] = 0.0
    cam = splats.views[0]
    mean = gaussians.means[g]
    log_scale = gaussians.log_scales[g]
    p = projection_of(cam, mean, log_scale, gaussians.quats[g], gaussians.opacity_logits[g])
    if p.drawn == 0 or not color_is_finite(gaussians.sh, g, degree):
        return
    put_record(p, splats.records[g], 0, 1)
    put_color(cam, g, mean, gaussians.sh, degree, splats.records)
    splats.centers[g] = p.z
    splats.depths[g] = p.depth
    splats.boxes[g] = p.box
