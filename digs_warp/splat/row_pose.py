"""The pose of the row in which a point lies, on the device; see `digs_warp.splat.camera_motion`."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class RowPose:
    """The pose of the row in which a point lies."""

    moment: float
    varies: float  # 1, or 0 where the point lies above or below the image: the moment is that of the edge
    turned: wp.mat33  # C
    turn: wp.vec3  # w
    shift: wp.vec3  # t


@wp.func
def moment_of(row: float) -> wp.vec2:
    """When the row at this share of the image's height is read, and 1 if it is inside of the image."""
    moment = row - 0.5
    inside = wp.where(moment > -0.5, 1.0, 0.0) * wp.where(moment < 0.5, 1.0, 0.0)
    return wp.vec2(wp.where(moment > 0.5, 0.5, wp.where(moment < -0.5, -0.5, moment)), inside)


@wp.func
def moment_gradient(pose: RowPose, d_turn: wp.vec3, d_shift: wp.vec3) -> float:
    """dL/ds, from the gradient in a motion of the row's camera in its own axes."""
    half = 0.5 * pose.moment * pose.turn
    # The angle 2 atan(s |w| / 2) grows by |w| / (1 + s^2 |w|^2 / 4).
    rate = wp.dot(d_turn, pose.turn) / (1.0 + wp.dot(half, half))
    return pose.varies * (rate + wp.dot(pose.turned * d_shift, pose.shift))
