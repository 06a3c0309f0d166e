"""A camera inside its surround, for kernels, and the sRGB encoding of what it sees."""

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from digs_warp.checks import DigsError
from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera
from digs_warp.sim.render.surround import Boundary, make_boundary, unit
from digs_warp.sim.render.views import CameraTrack
from digs_warp.sim.scene.environment import Surround

# Steps of linear light from 0 to 1 whose first byte is kept: sRGB is at most one byte further at their end.
STARTS = wp.constant(4096.0)


@wp.struct
class Encoding:
    """Where the bytes change."""

    limits: wp.array[
        float
    ]  # [256] linear light from which the next byte is nearer; never for the last
    starts: wp.array[wp.uint8]  # [STARTS + 1] byte at the beginning of each step


@wp.func
def srgb_byte(encoding: Encoding, linear: float) -> wp.uint8:
    """Clip a linear value and return the sRGB byte that is nearest after encoding."""
    value = wp.clamp(linear, 0.0, 1.0)
    byte = int(encoding.starts[int(value * STARTS)])
    return wp.uint8(wp.where(encoding.limits[byte] <= value, byte + 1, byte))


@cache
def srgb_encoding() -> Encoding:
    """Return the tables."""
    limits = np.append(linear_from_srgb((np.arange(255) + 0.5) / 255), np.inf).astype(np.float32)
    steps = np.arange(int(STARTS) + 1, dtype=np.float32) / np.float32(STARTS)
    encoding = Encoding()
    encoding.limits = wp.array(limits, dtype=float, device="cpu")
    starts = np.searchsorted(limits, steps, side="right").astype(np.uint8)
    encoding.starts = wp.array(starts, dtype=wp.uint8, device="cpu")
    return encoding


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
    boundary: Boundary  # of the surround
    pixel_cone: float  # spread of the cone of one sample [rad]
    pixel_angle: float  # width of a pixel [rad]


@wp.struct
class Track:
    """The camera's poses for each band of rows at each moment of the exposure."""

    rotations: wp.array2d[wp.mat33]  # [bands, moments] world_from_cam
    centers: wp.array2d[wp.vec3]  # [bands, moments]
    bands: wp.array[int]  # [height] band of each row
    moments: int
    # How many texels of the panorama a pixel is wide, for a camera in the panorama's place.
    texels: float
    # [bands] mean over the moments; no rotation, but nearly one
    middle_rotations: wp.array[wp.mat33]
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
    now.boundary = view.boundary
    now.pixel_cone = view.pixel_cone
    now.pixel_angle = view.pixel_angle
    band = track.bands[row]
    now.world_from_cam = track.rotations[band, moment]
    now.center = track.centers[band, moment]
    return now


@wp.func
def ray_direction_cam(view: View, x: float, y: float) -> wp.vec3:
    """Unit direction through image position (x, y) [px] in camera axes."""
    return unit(wp.vec3((x - view.cx) / view.fx, (y - view.cy) / view.fy, 1.0))


@wp.func
def center_ray(view: View, pixel: int) -> wp.vec3:
    """Unit direction through the center of a pixel, numbered in reading order, in camera axes."""
    return ray_direction_cam(
        view, float(pixel % view.width) + 0.5, float(pixel // view.width) + 0.5
    )


def check_inside(center: np.ndarray, surround: Surround) -> None:
    """Raise a `DigsError` if a camera's center in the world, (3,), is outside the surround."""
    if surround.holds(center):
        return
    if surround.floor is not None and center[2] <= surround.floor:
        raise DigsError(
            f"camera: at z = {center[2]:.3g} m, on or below the floor at z = {surround.floor:.3g} m; raise it"
        )
    raise DigsError(
        f"camera: {float(np.linalg.norm(center)):.3g} m from the origin, outside the surround of radius "
        f"{surround.radius:.3g} m; make the environment larger or move the camera closer"
    )


def make_track(track: CameraTrack, surround: Surround) -> Track:
    """Return a camera's track for kernels.

    Raises:
        DigsError: the camera leaves the surround.
    """
    poses = track.world_from_cam
    for center in poses[..., :3, 3].reshape(-1, 3):
        check_inside(center, surround)
    edges = np.array(track.edges)
    bands = np.repeat(np.arange(len(poses)), np.diff(edges)).astype(np.int32)
    device = Track()
    device.rotations = _device_array(poses[..., :3, :3], wp.mat33)
    device.centers = _device_array(poses[..., :3, 3], wp.vec3)
    device.bands = wp.array(bands, dtype=int, device="cpu", copy=False)
    device.moments = poses.shape[1]
    middle = poses.mean(axis=1, keepdims=True)
    # A unit vector moves by at most the norm of the difference, and turns by nearly as many radians.
    turns = np.zeros(len(poses))
    if device.moments > 1:
        turns = np.linalg.norm((poses - middle)[..., :3, :3], ord=2, axis=(-2, -1)).max(axis=1)
    ways = np.linalg.norm((poses - middle)[..., :3, 3], axis=-1).max(axis=1)
    device.middle_rotations = _device_array(middle[:, 0, :3, :3], wp.mat33)
    device.middle_centers = _device_array(middle[:, 0, :3, 3], wp.vec3)
    device.swings = _device_array(SWING_MARGIN * turns, float)
    device.shifts = _device_array(ways, float)
    return device


def _device_array(values: np.ndarray, dtype: Any) -> wp.array:
    """Return an array for kernels on the memory of a copy in single precision."""
    # A copy by Warp takes three times as long, which counts where tiny images are rendered.
    return wp.array(np.array(values, np.float32, order="C"), dtype=dtype, device="cpu", copy=False)


def make_view(camera: Camera, surround: Surround, samples_per_pixel: float = 1) -> View:
    """Return the camera for kernels.

    Raises:
        DigsError: the camera is outside the surround.
    """
    check_inside(camera.center_world, surround)
    k = camera.intrinsics
    view = View()
    view.width = k.width
    view.fx, view.fy, view.cx, view.cy = k.fx, k.fy, k.cx, k.cy
    view.world_from_cam = wp.mat33(camera.world_from_cam[:3, :3].astype(np.float32))
    view.center = wp.vec3(*camera.center_world)
    view.boundary = make_boundary(surround)
    # The samples of a pixel share its area: each has a cone of 1 / sqrt(n) of its width.
    view.pixel_angle = 1.0 / min(k.fx, k.fy)
    view.pixel_cone = view.pixel_angle / np.sqrt(samples_per_pixel)
    return view
