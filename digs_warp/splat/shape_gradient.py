"""From the gradient of a splat back to one Gaussian: functions of the device, and a kernel for one at a time.

Written by hand: it fuses the sum over a splat's tiles, the projection and the color in one pass, which
Warp's generated adjoint cannot. Tests compare it with central differences of a float64 twin. The notation is
that of `digs_warp.splat.footprint`.
"""

import warp as wp

from digs_warp.device.elementary import sigmoid
from digs_warp.splat.config import MIN_COMPENSATION
from digs_warp.splat.footprint import (
    Footprint,
    ViewParams,
    footprint_of,
    moment_gradient,
    rotation_adjoint,
    spread_of,
)
from digs_warp.splat.project import compensation
from digs_warp.splat.records import (
    COLOR_FIELDS,
    SPLAT_A,
    SPLAT_B,
    SPLAT_C,
    SPLAT_RED,
    GaussianArrays,
    PairGradients,
    Splats,
    StatisticsArrays,
)
from digs_warp.splat.shade import sh_adjoint

wp.set_module_options({"enable_backward": False})

_MIN_COMPENSATION = wp.constant(MIN_COMPENSATION)
_DEPTH = wp.constant(COLOR_FIELDS)  # column of a gradient record


@wp.struct
class SplatGradient:
    """dL / d(splat), summed over its tiles."""

    u: float
    v: float
    a: float
    b: float
    c: float
    opacity: float
    color: wp.vec3
    depth: float


@wp.func
def gather(begin: int, end: int, pairs: PairGradients) -> SplatGradient:
    """Sum the records ``begin`` .. ``end`` - 1 in a fixed order."""
    d = SplatGradient()
    for pair in range(begin, end):
        d.u += pairs.records[pair, 0]
        d.v += pairs.records[pair, 1]
        d.a += pairs.records[pair, 2]
        d.b += pairs.records[pair, 3]
        d.c += pairs.records[pair, 4]
        d.opacity += pairs.records[pair, 5]
        d.color += wp.vec3(pairs.records[pair, 6], pairs.records[pair, 7], pairs.records[pair, 8])
        if pairs.records.shape[1] > _DEPTH:
            d.depth += pairs.records[pair, _DEPTH]
    return d


@wp.func
def conic_of(records: wp.array2d[float], g: int) -> wp.vec3:
    """A, B and C of a splat."""
    return wp.vec3(records[g, SPLAT_A], records[g, SPLAT_B], records[g, SPLAT_C])


@wp.func
def still_gradient(cam: ViewParams, f: Footprint, d_point: wp.vec3, d_axes: wp.mat33) -> wp.vec3:
    """dL/d(center in the camera of the middle row), from that in the row's camera: its point p, and axes V.

    The axes of a Gaussian turn with the camera's motion (w, t) in its own frame, and p moves by p x w - t:
    dL/dw = dL/dp x p - axial(dL/dV V^T), dL/dt = -dL/dp, with axial(K) = (K21 - K12, K02 - K20, K10 - K01).
    """
    of_axes = d_axes * wp.transpose(f.axes)
    axial = wp.vec3(
        of_axes[2, 1] - of_axes[1, 2], of_axes[0, 2] - of_axes[2, 0], of_axes[1, 0] - of_axes[0, 1]
    )
    d_turn = wp.cross(d_point, f.point) - axial
    moment = moment_gradient(f.row, d_turn, -d_point)
    # The row that shows the center depends on where the camera of the middle row sees it.
    d_tangent = wp.where(f.row.varies != 0.0, moment * cam.fy / float(cam.height), 0.0)
    inverse_z = wp.where(f.row.varies != 0.0, 1.0 / f.still[2], 0.0)
    by_row = d_tangent * inverse_z * wp.vec3(0.0, 1.0, -f.still[1] * inverse_z)
    return f.row.turned * d_point + by_row


@wp.struct
class ShapeGradient:
    """dL / d(Gaussian) but for what its color contributes."""

    point: wp.vec3  # of the center in the camera of the middle row
    log_scale: wp.vec3
    quat: wp.vec4
    opacity_logit: float


@wp.func
def shape_gradient(
    cam: ViewParams,
    f: Footprint,
    quat: wp.vec4,
    opacity_logit: float,
    conic: wp.vec3,
    d: SplatGradient,
) -> ShapeGradient:
    """Pull a splat's gradient back; straight-line code, so that several are done at once.

    Args:
        cam: the view.
        f: the Gaussian's footprint in it.
        quat: its raw quaternion.
        opacity_logit: its opacity.
        conic: A, B and C of the splat.
        d: the gradient; its color is not read.
    """
    # conic -> covariance: G_cov = -Q G_Q Q with the symmetric G_Q = [[a, b/2], [b/2, c]].
    h00 = d.a * conic[0] + 0.5 * d.b * conic[1]
    h01 = d.a * conic[1] + 0.5 * d.b * conic[2]
    h10 = 0.5 * d.b * conic[0] + d.c * conic[1]
    h11 = 0.5 * d.b * conic[1] + d.c * conic[2]
    g00 = -(conic[0] * h00 + conic[1] * h10)
    g01 = -(conic[0] * h01 + conic[1] * h11)
    g11 = -(conic[1] * h01 + conic[2] * h11)
    # covariance -> M: G_M = 2 G_cov M
    dm0 = 2.0 * (g00 * f.m0 + g01 * f.m1)
    dm1 = 2.0 * (g01 * f.m0 + g11 * f.m1)

    # With antialiasing the opacity has a factor sqrt(rho), rho = det before / det of the dilation:
    # d ln(rho) = d det_before / det_before - d det / det
    opacity = sigmoid(opacity_logit)
    s = spread_of(cam, f)
    factor = wp.where(cam.antialias != 0, compensation(s.det_before, s.det), 1.0)
    rho = s.det_before / s.det
    d_rho = d.opacity * opacity * 0.5 / factor
    varies = cam.antialias != 0 and factor > _MIN_COMPENSATION
    grow = wp.where(varies, 2.0 * d_rho * (1.0 - rho) / s.det, 0.0)
    shrink_both = wp.where(varies, 2.0 * d_rho * rho * cam.dilation / s.det, 0.0)
    dm0 += grow * (s.c * f.m0 - s.b * f.m1) - shrink_both * f.m0
    dm1 += grow * (s.a * f.m1 - s.b * f.m0) - shrink_both * f.m1
    out = ShapeGradient()
    out.opacity_logit = d.opacity * factor * opacity * (1.0 - opacity)

    # M -> scales (M is linear in each), rotation
    out.log_scale = wp.cw_mul(dm0, f.m0) + wp.cw_mul(dm1, f.m1)
    dv0 = f.zoom_x * wp.cw_mul(dm0, f.sizes)
    dv1 = f.zoom_y * wp.cw_mul(dm1, f.sizes)
    dv2 = -f.limited_x * dv0 - f.limited_y * dv1
    d_axes = wp.matrix_from_rows(dv0, dv1, dv2)
    out.quat = rotation_adjoint(quat, wp.transpose(f.rotation) * d_axes)

    # center: through the pixel position, the factor 1/z of M, and the tangents where not clamped
    d_limited_x = -wp.dot(dv0, f.axes[2])
    d_limited_y = -wp.dot(dv1, f.axes[2])
    free_x = wp.where(f.limited_x == f.tangent_x, f.inverse_z, 0.0)
    free_y = wp.where(f.limited_y == f.tangent_y, f.inverse_z, 0.0)
    dx = d.u * f.zoom_x + free_x * d_limited_x
    dy = d.v * f.zoom_y + free_y * d_limited_y
    shrink = f.inverse_z * (out.log_scale[0] + out.log_scale[1] + out.log_scale[2])
    # x/z and y/z depend on z as on x and y, times minus the tangent.
    dz = d.depth - (dx * f.tangent_x + dy * f.tangent_y) - shrink
    out.point = still_gradient(cam, f, wp.vec3(dx, dy, dz), d_axes)
    return out


@wp.func
def color_gradient(
    cam: ViewParams,
    g: int,
    gaussians: GaussianArrays,
    degree: int,
    records: wp.array2d[float],
    adj_color: wp.vec3,
    adj_coefficients: wp.array2d[wp.vec3],
) -> wp.vec3:
    """Write the gradient of the coefficients; return what the color contributes to that of the center."""
    # None where the clamp at 0 holds.
    d_color = wp.vec3(
        wp.where(records[g, SPLAT_RED] > 0.0, adj_color[0], 0.0),
        wp.where(records[g, SPLAT_RED + 1] > 0.0, adj_color[1], 0.0),
        wp.where(records[g, SPLAT_RED + 2] > 0.0, adj_color[2], 0.0),
    )
    offset = gaussians.means[g] - cam.center_world
    distance = wp.length(offset)
    direction = offset / distance
    d_direction = sh_adjoint(gaussians.sh, g, degree, direction, d_color, adj_coefficients)
    for k in range((degree + 1) * (degree + 1), adj_coefficients.shape[1]):
        adj_coefficients[g, k] = wp.vec3(0.0, 0.0, 0.0)
    return (d_direction - direction * wp.dot(direction, d_direction)) / distance


@wp.func
def put_zeros(g: int, adjoint: GaussianArrays):
    """Write the gradient of a Gaussian that is not drawn."""
    adjoint.means[g] = wp.vec3(0.0, 0.0, 0.0)
    adjoint.log_scales[g] = wp.vec3(0.0, 0.0, 0.0)
    adjoint.quats[g] = wp.vec4(0.0, 0.0, 0.0, 0.0)
    adjoint.opacity_logits[g] = 0.0
    for k in range(adjoint.sh.shape[1]):
        adjoint.sh[g, k] = wp.vec3(0.0, 0.0, 0.0)


@wp.func
def add_statistics(cam: ViewParams, g: int, d_u: float, d_v: float, statistics: StatisticsArrays):
    """Add one view to `SplatStatistics`."""
    # Half the image is one unit, as in normalized device coordinates.
    half = wp.vec2(0.5 * float(cam.width), 0.5 * float(cam.height))
    size = wp.length(wp.cw_mul(wp.vec2(d_u, d_v), half))
    statistics.gradient_sums[g] = statistics.gradient_sums[g] + size
    statistics.counts[g] = statistics.counts[g] + 1.0


@wp.kernel
def project_backward_kernel(
    first: int,
    gaussians: GaussianArrays,
    degree: int,
    splats: Splats,
    pairs: PairGradients,
    most: int,  # of a splat with more records, the first one holds the sum of all
    # outputs
    adjoint: GaussianArrays,
    statistics: StatisticsArrays,
):
    """Sum a splat's gradient over its tiles in a fixed order and pull it back to the parameters."""
    g = first + wp.tid()
    begin = pairs.starts[g]
    end = pairs.starts[g + 1]
    if begin == end:
        put_zeros(g, adjoint)
        return
    d = gather(begin, wp.where(end - begin > most, begin + 1, end), pairs)
    cam = splats.views[0]
    quat = gaussians.quats[g]
    f = footprint_of(cam, gaussians.means[g], gaussians.log_scales[g], quat)
    conic = conic_of(splats.records, g)
    s = shape_gradient(cam, f, quat, gaussians.opacity_logits[g], conic, d)
    d_offset = color_gradient(cam, g, gaussians, degree, splats.records, d.color, adjoint.sh)
    adjoint.means[g] = wp.transpose(cam.rotation) * s.point + d_offset
    adjoint.log_scales[g] = s.log_scale
    adjoint.quats[g] = s.quat
    adjoint.opacity_logits[g] = s.opacity_logit
    if statistics.counts.shape[0] > 0:
        add_statistics(cam, g, d.u, d.v, statistics)
