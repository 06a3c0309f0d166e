# type: ignore
# (device code, which Warp's stubs do not type)
"""Gradient of the projection: from splats on the image back to Gaussians, camera and pose.

The gradient is written by hand: it fuses the sum over a splat's tiles, the projection and the colour in
one pass, which Warp's generated adjoint cannot. Tests compare it with central differences of a float64
twin. The notation is that of `digs_warp.splat.footprint`.

The camera moves in its own frame: ``world_from_cam' = world_from_cam exp(w, t)`` with a rotation vector
w [rad] and a translation t [m] along the camera's axes. A point p in the camera then moves by p x w - t, and
the axes V of a Gaussian turn with it: dL/dw = dL/dp x p - axial(dL/dV V^T), dL/dt = -dL/dp, where
axial(K) = (K21 - K12, K02 - K20, K10 - K01). The colour sees the camera's centre alone.
"""

import warp as wp

from digs_warp.splat.config import MIN_COMPENSATION
from digs_warp.splat.elementary import sigmoid
from digs_warp.splat.footprint import (
    Footprint,
    ViewParams,
    facing_sign,
    footprint_of,
    rotation_adjoint,
    shortest_axis,
)
from digs_warp.splat.project import compensation
from digs_warp.splat.records import SPLAT_A, SPLAT_B, SPLAT_C, SPLAT_RED
from digs_warp.splat.shade import sh_adjoint

wp.set_module_options({"enable_backward": False})

_MIN_COMPENSATION = wp.constant(MIN_COMPENSATION)

# Columns of a Gaussian's share in the gradient of the camera: rotation vector, translation, fx, fy, cx, cy.
CAMERA_FIELDS = 10
# Gaussians whose shares one thread sums.
SUM_BLOCK = 1024

_CAMERA_FIELDS = wp.constant(CAMERA_FIELDS)
_SUM_BLOCK = wp.constant(SUM_BLOCK)


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
    normal: wp.vec3
    absolute_u: float  # sums over pixels of |dL/du| and |dL/dv|
    absolute_v: float


@wp.func
def gather(
    begin: int,
    end: int,
    pair_gradients: wp.array2d[float],
    depth_field: int,
    normal_field: int,
    absolute_field: int,
) -> SplatGradient:
    """Sum the records of one splat in a fixed order; a field of -1 is not there."""
    d = SplatGradient()
    for pair in range(begin, end):
        d.u += pair_gradients[pair, 0]
        d.v += pair_gradients[pair, 1]
        d.a += pair_gradients[pair, 2]
        d.b += pair_gradients[pair, 3]
        d.c += pair_gradients[pair, 4]
        d.opacity += pair_gradients[pair, 5]
        d.color += wp.vec3(
            pair_gradients[pair, 6], pair_gradients[pair, 7], pair_gradients[pair, 8]
        )
        if depth_field >= 0:
            d.depth += pair_gradients[pair, depth_field]
        if normal_field >= 0:
            d.normal += wp.vec3(
                pair_gradients[pair, normal_field],
                pair_gradients[pair, normal_field + 1],
                pair_gradients[pair, normal_field + 2],
            )
        if absolute_field >= 0:
            d.absolute_u += pair_gradients[pair, absolute_field]
            d.absolute_v += pair_gradients[pair, absolute_field + 1]
    return d


@wp.func
def radius_of(f: Footprint, dilation: float) -> float:
    """Three standard deviations of the longer axis on the image [px]."""
    mean = 0.5 * (wp.dot(f.m0, f.m0) + wp.dot(f.m1, f.m1))
    half = 0.5 * (wp.dot(f.m0, f.m0) - wp.dot(f.m1, f.m1))
    largest = mean + wp.length(wp.vec2(half, wp.dot(f.m0, f.m1))) + dilation
    return 3.0 * wp.sqrt(largest)


@wp.kernel
def project_backward_kernel(
    first: int,
    views: wp.array[ViewParams],
    means: wp.array[wp.vec3],
    log_scales: wp.array[wp.vec3],
    quats: wp.array[wp.vec4],
    opacity_logits: wp.array[float],
    coefficients: wp.array2d[wp.vec3],
    degree: int,
    splats: wp.array2d[float],
    pair_starts: wp.array[int],  # [n + 1] pairs of splat g: pair_starts[g] .. pair_starts[g + 1]
    pair_gradients: wp.array2d[float],  # [pairs, fields of the layout]
    depth_field: int,  # columns of the layout
    normal_field: int,
    absolute_field: int,
    # outputs
    adj_means: wp.array[wp.vec3],
    adj_log_scales: wp.array[wp.vec3],
    adj_quats: wp.array[wp.vec4],
    adj_opacity_logits: wp.array[float],
    adj_coefficients: wp.array2d[wp.vec3],
    camera_shares: wp.array2d[float],  # [n, CAMERA_FIELDS]; empty: not wanted
    gradient_sums: wp.array[float],  # [n] of `SplatStatistics`; empty: not wanted
    absolute_sums: wp.array[float],  # [n]; empty: not wanted
    counts: wp.array[float],  # [n]
    max_radii: wp.array[float],  # [n]
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
        if camera_shares.shape[0] > 0:
            for field in range(_CAMERA_FIELDS):
                camera_shares[g, field] = 0.0
        return

    d = gather(begin, end, pair_gradients, depth_field, normal_field, absolute_field)
    cam = views[0]
    f = footprint_of(cam, means[g], log_scales[g], quats[g])

    # conic -> covariance: G_cov = -Q G_Q Q with the symmetric G_Q = [[a, b/2], [b/2, c]].
    qa = splats[g, SPLAT_A]
    qb = splats[g, SPLAT_B]
    qc = splats[g, SPLAT_C]
    h00 = d.a * qa + 0.5 * d.b * qb
    h01 = d.a * qb + 0.5 * d.b * qc
    h10 = 0.5 * d.b * qa + d.c * qb
    h11 = 0.5 * d.b * qb + d.c * qc
    g00 = -(qa * h00 + qb * h10)
    g01 = -(qa * h01 + qb * h11)
    g11 = -(qb * h01 + qc * h11)
    # covariance -> M: G_M = 2 G_cov M
    dm0 = 2.0 * (g00 * f.m0 + g01 * f.m1)
    dm1 = 2.0 * (g01 * f.m0 + g11 * f.m1)

    opacity = sigmoid(opacity_logits[g])
    factor = float(1.0)
    if cam.antialias != 0:
        # factor = sqrt(rho), rho = det before / det: d ln(rho) = d det_before / det_before - d det / det
        aa = wp.dot(f.m0, f.m0)
        cc = wp.dot(f.m1, f.m1)
        b = wp.dot(f.m0, f.m1)
        cross = wp.cross(f.m0, f.m1)
        det_before = wp.dot(cross, cross)
        det = det_before + cam.dilation * (aa + cc) + cam.dilation * cam.dilation
        factor = compensation(det_before, det)
        if factor > _MIN_COMPENSATION:
            rho = det_before / det
            d_rho = d.opacity * opacity * 0.5 / factor
            grow = 2.0 * d_rho * (1.0 - rho) / det
            shrink_0 = 2.0 * d_rho * rho * cam.dilation / det
            dm0 += grow * (cc * f.m0 - b * f.m1) - shrink_0 * f.m0
            dm1 += grow * (aa * f.m1 - b * f.m0) - shrink_0 * f.m1
    adj_opacity_logits[g] = d.opacity * factor * opacity * (1.0 - opacity)

    # M -> scales (M is linear in each), rotation
    d_log_scale = wp.cw_mul(dm0, f.m0) + wp.cw_mul(dm1, f.m1)
    adj_log_scales[g] = d_log_scale
    dv0 = f.zoom_x * wp.cw_mul(dm0, f.sizes)
    dv1 = f.zoom_y * wp.cw_mul(dm1, f.sizes)
    dv2 = -f.limited_x * dv0 - f.limited_y * dv1
    d_axes = wp.matrix_from_rows(dv0, dv1, dv2)
    if normal_field >= 0:
        axis = shortest_axis(f)
        sign = facing_sign(f, axis)
        for row in range(3):
            d_axes[row, axis] = d_axes[row, axis] + sign * d.normal[row]
    adj_quats[g] = rotation_adjoint(quats[g], wp.transpose(cam.rotation) * d_axes)

    # centre: through the pixel position, the factor 1/z of M, and the tangents where not clamped
    dx = d.u * f.zoom_x
    dy = d.v * f.zoom_y
    shrink = f.inverse_z * (d_log_scale[0] + d_log_scale[1] + d_log_scale[2])
    d_limited_x = -wp.dot(dv0, f.axes[2])
    d_limited_y = -wp.dot(dv1, f.axes[2])
    if f.limited_x == f.tangent_x:
        dx += f.inverse_z * d_limited_x
    if f.limited_y == f.tangent_y:
        dy += f.inverse_z * d_limited_y
    # x/z and y/z depend on z as on x and y, times minus the tangent.
    dz = d.depth - (dx * f.tangent_x + dy * f.tangent_y) - shrink
    d_point = wp.vec3(dx, dy, dz)

    # colour: no gradient where the clamp at 0 holds
    d_color = d.color
    for channel in range(3):
        if splats[g, SPLAT_RED + channel] <= 0.0:
            d_color[channel] = 0.0
    offset = means[g] - cam.center_world
    distance = wp.length(offset)
    direction = offset / distance
    d_direction = sh_adjoint(coefficients, g, degree, direction, d_color, adj_coefficients)
    for k in range((degree + 1) * (degree + 1), adj_coefficients.shape[1]):
        adj_coefficients[g, k] = wp.vec3(0.0, 0.0, 0.0)
    d_offset = (d_direction - direction * wp.dot(direction, d_direction)) / distance
    adj_means[g] = wp.transpose(cam.rotation) * d_point + d_offset

    if camera_shares.shape[0] > 0:
        turn = d_axes * wp.transpose(f.axes)
        axial = wp.vec3(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
        d_turn = wp.cross(d_point, f.point) - axial
        d_shift = -(d_point + cam.rotation * d_offset)
        d_fx = d.u * f.tangent_x + wp.dot(dm0, f.m0) / cam.fx
        d_fy = d.v * f.tangent_y + wp.dot(dm1, f.m1) / cam.fy
        d_cx = d.u
        d_cy = d.v
        # The limits of the tangents are (c - edge) / f.
        if f.limited_x != f.tangent_x:
            d_fx -= d_limited_x * f.limited_x / cam.fx
            d_cx -= d_limited_x / cam.fx
        if f.limited_y != f.tangent_y:
            d_fy -= d_limited_y * f.limited_y / cam.fy
            d_cy -= d_limited_y / cam.fy
        for i in range(3):
            camera_shares[g, i] = d_turn[i]
            camera_shares[g, 3 + i] = d_shift[i]
        camera_shares[g, 6] = d_fx
        camera_shares[g, 7] = d_fy
        camera_shares[g, 8] = d_cx
        camera_shares[g, 9] = d_cy

    if counts.shape[0] > 0:
        # Half the image is one unit, as in normalized device coordinates.
        half_width = 0.5 * float(cam.width)
        half_height = 0.5 * float(cam.height)
        gradient_sums[g] = gradient_sums[g] + wp.length(
            wp.vec2(d.u * half_width, d.v * half_height)
        )
        if absolute_field >= 0:
            size = wp.length(wp.vec2(d.absolute_u * half_width, d.absolute_v * half_height))
            absolute_sums[g] = absolute_sums[g] + size
        counts[g] = counts[g] + 1.0
        max_radii[g] = wp.max(max_radii[g], radius_of(f, cam.dilation))


@wp.kernel
def sum_camera_kernel(
    first: int,
    count: int,
    camera_shares: wp.array2d[float],  # [count, CAMERA_FIELDS]
    # outputs
    block_sums: wp.array2d[wp.float64],  # [blocks, CAMERA_FIELDS]
):
    """Sum the shares of a block of Gaussians in the order of their index."""
    block = first + wp.tid()
    begin = block * _SUM_BLOCK
    for field in range(_CAMERA_FIELDS):
        total = wp.float64(0.0)
        for g in range(begin, wp.min(begin + _SUM_BLOCK, count)):
            total += wp.float64(camera_shares[g, field])
        block_sums[block, field] = total
