"""Where the points that one eye sees appear in another eye, and whether something hides them there.

The other eye may be the right one, or the same camera at another time: the scene does not move. The eyes of
a rolling shutter see each band of rows from another place; a point appears in the band in which it lands.
"""

from typing import Any

import numpy as np
import warp as wp

from digs_warp.data.layers import Occlusion
from digs_warp.device.parallel import launch_parallel, packed
from digs_warp.geometry.reproject_kernel import is_inside, project, ray_through
from digs_warp.sim.render.surface import OPAQUE, Surface, trace
from digs_warp.sim.render.upload import DeviceScene
from digs_warp.sim.render.views import CameraTrack, Followed

wp.set_module_options({"enable_backward": False})

SEEN = wp.constant(wp.uint8(Occlusion.SEEN))
OUTSIDE = wp.constant(wp.uint8(Occlusion.OUTSIDE))
HIDDEN = wp.constant(wp.uint8(Occlusion.HIDDEN))

# Looks for the band in which a point lands. A band moves points by a fraction of its height, so that the
# second look mostly confirms the first.
ROUNDS = wp.constant(8)


# Points along a ray that differ by less than this share of their distance are the same point: float32 hits
# from two eyes differ by a tenth of that.
SAME_POINT = wp.constant(1.0e-4)


@wp.struct
class Sight:
    """A point that one eye sees."""

    origin: wp.vec3  # of that eye
    direction: wp.vec3  # unit, toward the point
    distance: float  # [m]


@wp.func
def is_same_side(surface: Surface, sight: Sight, toward: wp.vec3) -> bool:
    """Whether a second ray meets the side of a thin sheet that the first one does."""
    start = sight.distance * (1.0 - SAME_POINT)
    span = 2.0 * SAME_POINT * sight.distance
    origin = sight.origin + start * sight.direction
    hit = wp.mesh_query_ray(surface.mesh, origin, sight.direction, span)
    same = wp.dot(hit.normal, sight.direction) * wp.dot(hit.normal, toward) > 0.0
    return (not hit.result) or same


@wp.func
def is_clear(
    surface: Surface, sight: Sight, eye: wp.vec3, toward: wp.vec3, reach: float, cone: float
) -> bool:
    """Whether another eye sees the point, too: one ray, two among see-through things.

    Args:
        surface: the scene.
        sight: the point.
        eye: center of the other eye.
        toward: unit direction from there to the point.
        reach: its distance from there [m].
        cone: spread of a pixel [rad].
    """
    near = reach * (1.0 - SAME_POINT)
    if surface.see_through == 1:
        clear = trace(surface, eye, toward, near, cone, OPAQUE) < 0.0
        return clear and is_same_side(surface, sight, toward)
    hit = wp.mesh_query_ray(surface.mesh, eye, toward, reach * (1.0 + SAME_POINT))
    if not hit.result:
        return True
    # The other eye may see the other side of a thin sheet.
    same = wp.dot(hit.normal, sight.direction) * wp.dot(hit.normal, toward) > 0.0
    return hit.t >= near and same


@wp.struct
class Eye:
    """An eye, in double precision: single precision costs thousandths of a pixel."""

    width: int
    height: int
    fx: wp.float64
    fy: wp.float64
    cx: wp.float64
    cy: wp.float64
    rotations: wp.array[wp.mat33d]  # [bands] world_from_cam
    centers: wp.array[wp.vec3d]  # [bands]
    bands: wp.array[int]  # [height] band of each row


@wp.func
def ray_of_pixel(eye: Eye, column: int, row: int) -> wp.vec3d:
    """Direction through a pixel center in camera axes, with z = 1."""
    half = wp.float64(0.5)
    u, v = wp.float64(column) + half, wp.float64(row) + half
    x, y = ray_through(u, v, eye.fx, eye.fy, eye.cx, eye.cy)
    return wp.vec3d(x, y, wp.float64(1.0))


@wp.func
def appears_at(eye: Eye, band: int, point: wp.vec3d) -> wp.vec3d:
    """Column and row [px] at which the camera of a band sees a point, and its planar z [m]."""
    cam = wp.transpose(eye.rotations[band]) * (point - eye.centers[band])
    u, v = project(cam, eye.fx, eye.fy, eye.cx, eye.cy)
    return wp.vec3d(u, v, cam[2])


@wp.kernel
def follow_kernel(
    first: int,
    source: Eye,
    target: Eye,
    surface: Surface,
    pixels: wp.array[int],
    depth: wp.array[float],  # [height * width] planar z of what the source sees [m]
    cone: float,  # spread of a pixel [rad]
    # outputs
    shifts: wp.array[wp.vec2],  # [pixels] to the right and down [px]
    depths: wp.array[float],  # [pixels] planar z in the target [m]
    states: wp.array[wp.uint8],  # [pixels] `Occlusion`
):
    """Follow the point at a pixel center into the target."""
    index = first + wp.tid()
    pixel = pixels[index]
    column = pixel % source.width
    row = pixel // source.width
    nothing = wp.float32(wp.nan)
    shifts[index] = wp.vec2(nothing, nothing)
    depths[index] = nothing
    states[index] = OUTSIDE
    z = wp.float64(depth[pixel])
    from_band = source.bands[row]
    origin = source.centers[from_band]
    point = origin + source.rotations[from_band] * (z * ray_of_pixel(source, column, row))
    band = target.bands[wp.min(row, target.height - 1)]
    place = appears_at(target, band, point)
    for _round in range(ROUNDS):
        if not place[2] > wp.float64(0.0):
            return
        landed_row = wp.clamp(place[1], wp.float64(0.0), wp.float64(target.height - 1))
        landed = target.bands[int(landed_row)]
        if landed == band:
            break
        band = landed
        place = appears_at(target, band, point)
    if not place[2] > wp.float64(0.0):
        return
    half = wp.float64(0.5)
    right = place[0] - wp.float64(column) - half
    down = place[1] - wp.float64(row) - half
    shifts[index] = wp.vec2(float(right), float(down))
    depths[index] = float(place[2])
    if is_inside(place[0], place[1], place[2], target.width, target.height):
        away = target.centers[band]
        sight = Sight()
        sight.origin = wp.vec3(origin)
        sight.direction = wp.vec3(wp.normalize(point - origin))
        sight.distance = float(wp.length(point - origin))
        toward = wp.vec3(wp.normalize(point - away))
        reach = float(wp.length(point - away))
        clear = is_clear(surface, sight, wp.vec3(away), toward, reach, cone)
        states[index] = wp.where(clear, SEEN, HIDDEN)


def follow(
    scene: DeviceScene,
    source: CameraTrack,
    depth: np.ndarray,
    target: CameraTrack,
    threads: int = 0,
) -> Followed:
    """Follow all points of an image into another eye; see `RaycastRenderer.follow`."""
    shape = depth.shape
    shifts = np.full((*shape, 2), np.nan, np.float32)
    depths = np.full(shape, np.nan, np.float32)
    states = np.full(shape, Occlusion.OUTSIDE, np.uint8)
    known = depth > 0  # NaN is not
    shifts[known], depths[known], states[known] = follow_some(
        scene, source, depth, known, target, threads
    )
    return Followed(shifts, depths, states)


def follow_some(
    scene: DeviceScene,
    source: CameraTrack,
    depth: np.ndarray,
    where: np.ndarray,
    target: CameraTrack,
    threads: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Follow the points at ``where``; return their shifts, depths and states, as `Followed` has them."""
    pixels = np.flatnonzero(where).astype(np.int32)
    count = len(pixels)
    found = [wp.empty(count, dtype=kind, device="cpu") for kind in (wp.vec2, float, wp.uint8)]
    seen = np.ascontiguousarray(depth, np.float32).reshape(-1)
    images = [wp.array(each, device="cpu", copy=False) for each in (pixels, seen)]
    cone = 1.0 / min(source.intrinsics.fx, source.intrinsics.fy)
    inputs = [_eye(source), _eye(target), scene.surface, *images, cone, *found]
    launch_parallel(follow_kernel, count, inputs, threads=threads)
    shifts, depths, states = (each.numpy() for each in found)
    return shifts, depths, states


def _eye(track: CameraTrack) -> Any:
    """Return an eye for the kernel, from the first moment of each band."""
    k, poses = track.intrinsics, track.world_from_cam[:, 0]
    bands = np.repeat(np.arange(len(poses)), np.diff(track.edges)).astype(np.int32)
    rotations, centers = (
        np.ascontiguousarray(part) for part in (poses[:, :3, :3], poses[:, :3, 3])
    )
    return packed(
        Eye,
        width=k.width,
        height=k.height,
        fx=k.fx,
        fy=k.fy,
        cx=k.cx,
        cy=k.cy,
        rotations=wp.array(rotations, dtype=wp.mat33d, device="cpu"),
        centers=wp.array(centers, dtype=wp.vec3d, device="cpu"),
        bands=wp.array(bands, dtype=int, device="cpu"),
    )
