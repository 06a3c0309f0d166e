"""Gradient of the projection: from splats on the image back to Gaussians, camera and pose.

The camera moves in its own frame: ``world_from_cam' = world_from_cam exp(w, t)`` with a rotation vector
w [rad] and a translation t [m] along the camera's axes. A point p in the camera then moves by p x w - t, and
the axes V of a Gaussian turn with it: dL/dw = dL/dp x p - axial(dL/dV V^T), dL/dt = -dL/dp, where
axial(K) = (K21 - K12, K02 - K20, K10 - K01). The color sees the camera's center alone. With a rolling shutter
p and V are those of the row's camera, and `digs_warp.splat.shape_gradient.motion_gradient` brings dL/dw and
dL/dt back to the camera of the middle row.
"""

import warp as wp

from digs_warp.splat.footprint import facing_sign, footprint_of, shortest_axis
from digs_warp.splat.records import GaussianArrays, PairGradients, Splats, StatisticsArrays
from digs_warp.splat.shape_gradient import (
    add_statistics,
    color_gradient,
    conic_of,
    gather,
    put_zeros,
    shape_gradient,
)

wp.set_module_options({"enable_backward": False})

# Columns of a Gaussian's share in the gradient of the camera: rotation vector, translation, fx, fy, cx, cy.
CAMERA_FIELDS = 10

_CAMERA_FIELDS = wp.constant(CAMERA_FIELDS)


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
    camera_shares: wp.array2d[float],  # [n, CAMERA_FIELDS]; empty: not wanted
    statistics: StatisticsArrays,
):
    """Sum a splat's gradient over its tiles in a fixed order and pull it back to the parameters."""
    g = first + wp.tid()
    begin = pairs.starts[g]
    end = pairs.starts[g + 1]
    if begin == end:
        put_zeros(g, adjoint)
        if camera_shares.shape[0] > 0:
            for field in range(_CAMERA_FIELDS):
                camera_shares[g, field] = 0.0
        return

    d = gather(begin, wp.where(end - begin > most, begin + 1, end), pairs)
    cam = splats.views[0]
    quat = gaussians.quats[g]
    f = footprint_of(cam, gaussians.means[g], gaussians.log_scales[g], quat)
    d_normal_axes = wp.mat33()
    if pairs.normal >= 0:
        axis = shortest_axis(f)
        sign = facing_sign(f, axis)
        for row in range(3):
            d_normal_axes[row, axis] = sign * d.normal[row]
    conic = conic_of(splats.records, g)
    s = shape_gradient(cam, f, quat, gaussians.opacity_logits[g], conic, d, d_normal_axes)
    d_offset = color_gradient(cam, g, gaussians, degree, splats.records, d.color, adjoint.sh)
    adjoint.means[g] = wp.transpose(cam.rotation) * s.motion.point + d_offset
    adjoint.log_scales[g] = s.log_scale
    adjoint.quats[g] = s.quat
    adjoint.opacity_logits[g] = s.opacity_logit

    if camera_shares.shape[0] > 0:
        d_turn = s.motion.turn
        d_shift = s.motion.shift - cam.rotation * d_offset
        d_fx = d.u * f.tangent_x + s.row_x / cam.fx
        d_fy = d.v * f.tangent_y + s.row_y / cam.fy
        d_cx = d.u
        d_cy = d.v
        # The row that shows the center is fy y/z + cy, from the pose of the middle row.
        d_row = s.motion.moment / float(cam.height)
        if d_row != 0.0:
            d_fy += d_row * f.still[1] / f.still[2]
            d_cy += d_row
        # The limits of the tangents are (c - edge) / f.
        if f.limited_x != f.tangent_x:
            d_fx -= s.limited_x * f.limited_x / cam.fx
            d_cx -= s.limited_x / cam.fx
        if f.limited_y != f.tangent_y:
            d_fy -= s.limited_y * f.limited_y / cam.fy
            d_cy -= s.limited_y / cam.fy
        for i in range(3):
            camera_shares[g, i] = d_turn[i]
            camera_shares[g, 3 + i] = d_shift[i]
        camera_shares[g, 6] = d_fx
        camera_shares[g, 7] = d_fy
        camera_shares[g, 8] = d_cx
        camera_shares[g, 9] = d_cy

    if statistics.counts.shape[0] > 0:
        add_statistics(cam, g, d.u, d.v, d.absolute_u, d.absolute_v, statistics)
