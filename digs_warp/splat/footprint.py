"""One Gaussian through one camera: the linearized projection, as plain functions of the device.

Legend (EWA splatting as in 3DGS): p = R_cw mu + t the center in the camera, X = x/z and Y = y/z its
tangents (clamped near the image border), V = R_cw R(q), S = diag(exp(log_scale)),

    m0[k] = fx/z (V[0,k] - X V[2,k]) S[k]      rows of the 2x3 matrix M = J V S
    m1[k] = fy/z (V[1,k] - Y V[2,k]) S[k]      R_cw and t are those of the row that shows the center
    cov   = M M^T + dilation I = [[a, b], [b, c]],   conic (A, B, C) = (c, -b, a) / det
"""

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.elementary import exp_of, larger, smaller
from digs_warp.geometry.camera import Camera
from digs_warp.splat.camera_motion import STILL, RowMotion
from digs_warp.splat.config import JACOBIAN_MARGIN, NEAR_SHARE, REACH, TILE_SIZE, RasterOptions

wp.set_module_options({"enable_backward": False})

_MARGIN = wp.constant(JACOBIAN_MARGIN)


@wp.struct
class RowPose:
    """The pose of the row in which a point lies; `digs_warp.splat.camera_motion` has the formulas."""

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


@wp.struct
class ViewParams:
    """What the kernels know of a view: the camera, the tiles to draw, the options; pixels and metres."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    near: float
    rotation: wp.mat33  # cam_from_world; of the middle row, as all of these
    translation: wp.vec3
    center_world: wp.vec3
    turn: wp.vec3  # of `digs_warp.splat.camera_motion.RowMotion`
    shift: wp.vec3
    columns: int  # of tiles
    rows: int
    # Of `digs_warp.splat.config.RasterOptions`.
    dilation: float
    antialias: int
    reach: float  # of the place that the depth is of


def near_plane(camera: Camera, scene_center: np.ndarray) -> float:
    """Return the near plane [m]: a share of the distance to the scene, so that units do not matter."""
    return max(1e-6, NEAR_SHARE * float(np.linalg.norm(camera.center_world - scene_center)))


@cache
def _form() -> Any:
    """NumPy's type of `ViewParams`: a tenth of a millisecond to make."""
    return np.dtype(ViewParams.numpy_dtype())


def view_params(
    camera: Camera,
    near: float,
    options: RasterOptions,
    rows: RowMotion | None = None,
) -> np.ndarray:
    """Return a one-element structured array for `ViewParams`.

    Args:
        camera: the camera.
        near: Gaussians whose center is nearer than this [m] are not drawn.
        options: how splats are drawn.
        rows: how the camera moves while the rows are read; default: not at all.
    """
    k = camera.intrinsics
    record = np.zeros(1, dtype=_form())
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        record[name] = getattr(k, name)
    record["near"] = near
    record["rotation"] = camera.cam_from_world[:3, :3]
    record["translation"] = camera.cam_from_world[:3, 3]
    record["center_world"] = camera.center_world
    motion = rows or STILL
    record["turn"], record["shift"] = motion.turn, motion.shift
    record["columns"] = -(-k.width // TILE_SIZE)
    record["rows"] = -(-k.height // TILE_SIZE)
    record["dilation"], record["antialias"] = options.dilation, options.antialias
    record["reach"] = REACH if options.depth_of == "skin" else 0.0
    return record


@wp.func
def rotation_of(quat: wp.vec4) -> wp.mat33:
    """Rotation of a quaternion xyzw that is not normalized; a zero quaternion is no rotation."""
    n = wp.length(quat)
    q = quat / wp.where(n == 0.0, 1.0, n)
    x = q[0]
    y = q[1]
    z = q[2]
    w = q[3]
    # fmt: off
    return wp.mat33(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )
    # fmt: on


@wp.func
def rotation_adjoint(quat: wp.vec4, d: wp.mat33) -> wp.vec4:
    """Gradient of `rotation_of` with respect to the raw quaternion, given the gradient of the matrix."""
    n = wp.length(quat)
    inverse = wp.where(n == 0.0, 0.0, 1.0 / n)
    q = quat * inverse
    x = q[0]
    y = q[1]
    z = q[2]
    w = q[3]
    s01 = d[0, 1] + d[1, 0]
    s02 = d[0, 2] + d[2, 0]
    s12 = d[1, 2] + d[2, 1]
    a21 = d[2, 1] - d[1, 2]
    a02 = d[0, 2] - d[2, 0]
    a10 = d[1, 0] - d[0, 1]
    unit = wp.vec4(
        2.0 * (y * s01 + z * s02 - 2.0 * x * (d[1, 1] + d[2, 2]) + w * a21),
        2.0 * (x * s01 + z * s12 - 2.0 * y * (d[0, 0] + d[2, 2]) + w * a02),
        2.0 * (x * s02 + y * s12 - 2.0 * z * (d[0, 0] + d[1, 1]) + w * a10),
        2.0 * (x * a21 + y * a02 + z * a10),
    )
    # Only the part orthogonal to q changes the normalized quaternion.
    return (unit - q * wp.dot(q, unit)) * inverse


@wp.func
def clamped_tangent(tangent: float, focal: float, center: float, size: float) -> float:
    """x/z, kept within the image plus a margin; asymmetric for an off-center principal point."""
    margin = _MARGIN * 0.5 * size / focal
    low = -center / focal - margin
    high = (size - center) / focal + margin
    return smaller(larger(tangent, low), high)


@wp.struct
class Footprint:
    """A Gaussian as the camera sees it, up to the 2x3 matrix M; see the legend of the module."""

    still: wp.vec3  # the center in the camera of the middle row
    row: RowPose  # of the row that shows it
    rotation: wp.mat33  # of that row's camera: cam_from_world
    point: wp.vec3  # p, the center in that camera
    inverse_z: float
    tangent_x: float  # x/z and y/z ...
    tangent_y: float
    limited_x: float  # ... and as M uses them: X and Y
    limited_y: float
    zoom_x: float  # fx/z and fy/z
    zoom_y: float
    axes: wp.mat33  # V
    sizes: wp.vec3  # the diagonal of S
    m0: wp.vec3
    m1: wp.vec3


@wp.func
def row_pose(cam: ViewParams, still: wp.vec3) -> RowPose:
    """The pose of the row in which the camera of the middle row sees a point."""
    pose = RowPose()
    found = moment_of((cam.fy * still[1] / still[2] + cam.cy) / float(cam.height))
    pose.moment = found[0]
    pose.varies = found[1]
    pose.turn = cam.turn
    pose.shift = cam.shift
    half = 0.5 * pose.moment * cam.turn
    pose.turned = rotation_of(wp.vec4(half[0], half[1], half[2], 1.0))
    return pose


@wp.func
def footprint_of(cam: ViewParams, mean: wp.vec3, log_scale: wp.vec3, quat: wp.vec4) -> Footprint:
    """Linearize the projection at the center of a Gaussian that lies before the camera."""
    f = Footprint()
    f.still = cam.rotation * mean + cam.translation
    f.row = row_pose(cam, f.still)
    unturned = wp.transpose(f.row.turned)
    f.rotation = unturned * cam.rotation
    f.point = unturned * (f.still - f.row.moment * f.row.shift)
    f.inverse_z = 1.0 / f.point[2]
    f.tangent_x = f.point[0] * f.inverse_z
    f.tangent_y = f.point[1] * f.inverse_z
    f.limited_x = clamped_tangent(f.tangent_x, cam.fx, cam.cx, float(cam.width))
    f.limited_y = clamped_tangent(f.tangent_y, cam.fy, cam.cy, float(cam.height))
    f.zoom_x = cam.fx * f.inverse_z
    f.zoom_y = cam.fy * f.inverse_z
    f.axes = f.rotation * rotation_of(quat)
    f.sizes = wp.vec3(exp_of(log_scale[0]), exp_of(log_scale[1]), exp_of(log_scale[2]))
    f.m0 = f.zoom_x * wp.cw_mul(f.axes[0] - f.limited_x * f.axes[2], f.sizes)
    f.m1 = f.zoom_y * wp.cw_mul(f.axes[1] - f.limited_y * f.axes[2], f.sizes)
    return f


@wp.struct
class Spread:
    """The covariance of a splat on the image [px^2], before the dilation; see `digs_warp.splat.project`."""

    a: float
    b: float
    c: float
    det_before: float  # of that matrix
    det: float  # of the dilated one


@wp.func
def spread_of(cam: ViewParams, f: Footprint) -> Spread:
    """Return M M^T and its determinants, as sums of squares."""
    s = Spread()
    s.a = wp.dot(f.m0, f.m0)
    s.b = wp.dot(f.m0, f.m1)
    s.c = wp.dot(f.m1, f.m1)
    cross = wp.cross(f.m0, f.m1)
    s.det_before = wp.dot(cross, cross)
    s.det = s.det_before + cam.dilation * (s.a + s.c) + cam.dilation * cam.dilation
    return s
