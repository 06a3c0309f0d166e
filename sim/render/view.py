"""A camera inside its surround, for kernels."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.checks import DigsError
from digs_warp.sim.render.protocol import CameraTrack

wp.set_module_options({"enable_backward": False})

# Beyond everything [m]; the hit on the surround is computed analytically.
FAR = wp.constant(1.0e6)


# Up to 100 degrees, the angle between two unit vectors exceeds their distance by less than this factor.
SWING_MARGIN = 1.2


@wp.struct
class View:
    """A camera and its surround."""

    width: int
    fx: float
    fy: float
    cx: float
    cy: float
    world_from_cam: wp.mat33  # rotation
    center: wp.vec3
    surround_radius: float  # [m], sphere around the origin
    pixel_cone: float  # spread of the cone of one sample [rad]


@wp.struct
class Track:
    """The camera's poses for each band of rows at each moment of the exposure."""

    rotations: wp.array2d[wp.mat33]  # [bands, moments] world_from_cam
    centers: wp.array2d[wp.vec3]  # [bands, moments]
    bands: wp.array[int]  # [height] band of each row
    moments: int
    middle_rotations: wp.array[
        wp.mat33
    ]  # [bands] mean over the moments; no rotation, but nearly one
    middle_centers: wp.array[wp.vec3]  # [bands] mean over the moments
    swings: wp.array[float]  # [bands] largest turn away from the middle [rad]
    shifts: wp.array[float]  # [bands] largest distance from the middle [m]


@wp.func
def view_at(view: View, track: Track, row: int, moment: int) -> View:
    """The camera at one moment of a row's exposure."""
    now = View()
    now.width = view.width
    now.fx = view.fx
    now.fy = view.fy
    now.cx = view.cx
    now.cy = view.cy
    now.surround_radius = view.surround_radius
    now.pixel_cone = view.pixel_cone
    band = track.bands[row]
    now.world_from_cam = track.rotations[band, moment]
    now.center = track.centers[band, moment]
    return now


@wp.func
def ray_direction_cam(view: View, x: float, y: float) -> wp.vec3:
    """Unit direction through image position (x, y) [px] in camera axes."""
    return wp.normalize(wp.vec3((x - view.cx) / view.fx, (y - view.cy) / view.fy, 1.0))


@wp.func
def surround_distance(view: View, origin: wp.vec3, direction: wp.vec3) -> float:
    """Distance along the ray to the surrounding sphere, from inside."""
    along = wp.dot(origin, direction)
    gap = view.surround_radius * view.surround_radius - wp.dot(origin, origin)
    root = wp.sqrt(along * along + gap)
    # Two forms of the same root, each without cancellation for one sign of `along`.
    return wp.where(along > 0.0, gap / (root + along), root - along)


def check_inside(camera: Camera, surround_radius: float) -> None:
    """Raise a `DigsError` if the camera is outside the surround."""
    distance = float(np.linalg.norm(camera.center_world))
    if distance >= surround_radius:
        raise DigsError(
            f"camera: {distance:.3g} m from the origin, outside the surround of radius "
            f"{surround_radius:.3g} m; make the environment larger or move the camera closer"
        )


def make_track(track: CameraTrack, surround_radius: float) -> Track:
    """Return a camera's track for kernels.

    Raises:
        DigsError: the camera leaves the surround.
    """
    poses = track.world_from_cam
    for pose in poses.reshape(-1, 4, 4):
        check_inside(Camera(track.intrinsics, pose), surround_radius)
    edges = np.array(track.edges)
    bands = np.repeat(np.arange(len(poses)), np.diff(edges)).astype(np.int32)
    device = Track()
    rotations = np.ascontiguousarray(poses[..., :3, :3], np.float32)
    centers = np.ascontiguousarray(poses[..., :3, 3], np.float32)
    device.rotations = wp.array(rotations, dtype=wp.mat33, device="cpu")
    device.centers = wp.array(centers, dtype=wp.vec3, device="cpu")
    device.bands = wp.array(bands, dtype=int, device="cpu")
    device.moments = poses.shape[1]
    middle = poses.mean(axis=1, keepdims=True)
    # A unit vector moves by at most the norm of the difference, and turns by nearly as many radians.
    turns = np.linalg.norm((poses - middle)[..., :3, :3], ord=2, axis=(-2, -1)).max(axis=1)
    ways = np.linalg.norm((poses - middle)[..., :3, 3], axis=-1).max(axis=1)
    middle = np.ascontiguousarray(middle[:, 0], np.float32)
    device.middle_rotations = wp.array(middle[:, :3, :3], dtype=wp.mat33, device="cpu")
    device.middle_centers = wp.array(middle[:, :3, 3], dtype=wp.vec3, device="cpu")
    device.swings = wp.array(SWING_MARGIN * turns, dtype=float, device="cpu")
    device.shifts = wp.array(ways, dtype=float, device="cpu")
    return device


def make_view(camera: Camera, surround_radius: float, samples_per_pixel: int = 1) -> View:
    """Return the camera for kernels.

    Raises:
        DigsError: the camera is outside the surround.
    """
    check_inside(camera, surround_radius)
    k = camera.intrinsics
    view = View()
    view.width = k.width
    view.fx, view.fy, view.cx, view.cy = k.fx, k.fy, k.cx, k.cy
    view.world_from_cam = wp.mat33(camera.world_from_cam[:3, :3].astype(np.float32))
    view.center = wp.vec3(*camera.center_world)
    view.surround_radius = surround_radius
    # The samples of a pixel share its area: each has a cone of 1 / sqrt(n) of its width.
    view.pixel_cone = 1.0 / (min(k.fx, k.fy) * np.sqrt(samples_per_pixel))
    return view
