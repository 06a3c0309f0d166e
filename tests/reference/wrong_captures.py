"""Captures in memory with one thing wrong: a unit, the focal length, a convention, an order."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud, write_points
from digs_warp.geometry.camera import Intrinsics, pixel_centers
from digs_warp.geometry.rigid import (
    OPENCV_FROM_OPENGL,
    invert_rigid,
    matrix_from_rotation_vector,
    rigid,
)


def each_frame(capture: Capture, change: Callable[[Frame], Frame]) -> Capture:
    return replace(capture, frames=tuple(map(change, capture.frames)))


def each_layer(
    capture: Capture, layer: Layer, change: Callable[[np.ndarray], np.ndarray]
) -> Capture:
    return each_frame(capture, lambda f: f.with_layer(layer, change(f.load(layer))))


def scaled_depth(capture: Capture, factor: float) -> Capture:
    return each_layer(capture, Layer.DEPTH, lambda depth: depth * np.float32(factor))


def other_focal(capture: Capture, factor: float) -> Capture:
    def change(frame: Frame) -> Frame:
        k = frame.camera.intrinsics
        k = Intrinsics(k.width, k.height, k.fx * factor, k.fy * factor, k.cx, k.cy)
        return replace(frame, camera=replace(frame.camera, intrinsics=k))

    return each_frame(capture, change)


def with_poses(capture: Capture, change: Callable[[np.ndarray], np.ndarray]) -> Capture:
    """Change what the index holds: world from camera, OpenGL axes."""

    def read(frame: Frame) -> Frame:
        wrong = change(frame.camera.world_from_cam @ OPENCV_FROM_OPENGL) @ OPENCV_FROM_OPENGL
        return replace(frame, camera=replace(frame.camera, world_from_cam=wrong))

    return each_frame(capture, read)


def opencv_axes(capture: Capture) -> Capture:
    return with_poses(capture, lambda matrix: matrix @ OPENCV_FROM_OPENGL)


def inverted(capture: Capture) -> Capture:
    return with_poses(capture, invert_rigid)


def inverted_opencv(capture: Capture) -> Capture:
    return with_poses(capture, lambda matrix: invert_rigid(matrix @ OPENCV_FROM_OPENGL))


def shifted_depth(capture: Capture, columns: int) -> Capture:
    return each_layer(capture, Layer.DEPTH, lambda depth: np.roll(depth, columns, axis=1))


def depth_along_rays(capture: Capture) -> Capture:
    k = capture.frames[0].camera.intrinsics
    rays = (pixel_centers(k.width, k.height) - [k.cx, k.cy]) / [k.fx, k.fy]
    lengths = np.sqrt(1 + np.square(rays).sum(-1)).astype(np.float32)
    return each_layer(capture, Layer.DEPTH, lambda depth: depth * lengths)


def poses_of(capture: Capture, numbers: list[int]) -> Capture:
    """Frame i gets the pose of frame numbers[i]."""
    cameras = [frame.camera for frame in capture.frames]
    frames = zip(capture.frames, numbers, strict=True)
    return replace(capture, frames=tuple(replace(f, camera=cameras[n]) for f, n in frames))


def inverted_masks(capture: Capture) -> Capture:
    return each_layer(capture, Layer.MASK, lambda mask: 255 - mask)


def masks_of(capture: Capture, pixels: int) -> Capture:
    """Masks of so many pixels, in a row."""
    mask = np.zeros_like(capture.frames[0].load_mask())
    mask[40, 60 : 60 + pixels] = 255
    return each_layer(capture, Layer.MASK, lambda _: mask)


def with_points(capture: Capture, folder: Path, turn: np.ndarray) -> Capture:
    """Sparse points of the scene, turned against the cameras."""
    clouds = []
    for frame in capture.frames[::3]:
        depth, image = frame.load_depth()[4::9, 4::9], frame.load_image()[4::9, 4::9]
        k = frame.camera.intrinsics
        places = frame.camera.unproject(pixel_centers(k.width, k.height)[4::9, 4::9], depth)
        known = np.isfinite(depth)
        clouds.append(PointCloud(places[known] @ turn.T, image[known] / 255))
    write_points(folder / "points.ply", PointCloud.joined(clouds))
    return replace(capture, points=folder / "points.ply")


def other_exposures(capture: Capture, stops: float) -> Capture:
    """Each frame brighter or darker by up to so many stops."""
    rng = np.random.default_rng(0)

    def change(image: np.ndarray) -> np.ndarray:
        light = (image / 255.0) ** 2.2 * 2 ** rng.uniform(-stops, stops)
        return (255 * np.minimum(light, 1.0) ** (1 / 2.2)).astype(np.uint8)

    return each_layer(capture, Layer.IMAGE, change)


def with_passing_balls(capture: Capture, radius: float) -> Capture:
    """A red disc in front of everything, elsewhere in each frame; radius as a share of the height."""
    rng = np.random.default_rng(1)

    def change(frame: Frame) -> Frame:
        image, depth = frame.load_image(), frame.load_depth()
        height, width = depth.shape
        v, u = np.mgrid[:height, :width]
        x, y = rng.uniform(0.2, 0.8) * width, rng.uniform(0.3, 0.7) * height
        disc = np.hypot(u - x, v - y) < radius * height
        depth[disc] = 0.6 * np.nanmedian(depth)
        image[disc] = (200, 40, 40)
        return frame.with_layer(Layer.IMAGE, image).with_layer(Layer.DEPTH, depth)

    return each_frame(capture, change)


def with_gripper(capture: Capture) -> Capture:
    """A checkered thing in the lower middle of all photographs, with a little noise."""
    rng = np.random.default_rng(5)

    checks = rng.integers(20, 230, (60, 60))

    def change(image: np.ndarray) -> np.ndarray:
        image, (height, width) = image.copy(), image.shape[:2]
        side = -(-width // 30)
        pattern = checks.repeat(side, 0).repeat(side, 1)[:height, :width, None]
        where = np.s_[7 * height // 10 :, 2 * width // 5 : 3 * width // 5]
        image[where] = np.clip(pattern + rng.normal(0, 3, image.shape), 0, 255)[where]
        return image

    return each_layer(capture, Layer.IMAGE, change)


def with_a_jump(
    capture: Capture,
    shift: tuple[float, float, float],
    turn_degrees: float,
    numbers: Sequence[int] | None = None,
) -> Capture:
    """Some cameras, those from the middle on, elsewhere: shifted [m], and turned about the world's z axis."""
    motion = rigid(
        matrix_from_rotation_vector(np.radians([0.0, 0.0, turn_degrees])), np.array(shift)
    )
    frames = list(capture.frames)
    for number in range(len(frames) // 2, len(frames)) if numbers is None else numbers:
        camera = frames[number].camera
        other = replace(camera, world_from_cam=motion @ camera.world_from_cam)
        frames[number] = replace(frames[number], camera=other)
    return replace(capture, frames=tuple(frames))
