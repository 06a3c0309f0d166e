"""Rendered photographs for structure from motion: the built-in object in its room, true poses known."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at

if TYPE_CHECKING:
    from digs_warp.sim.render.raycast import RaycastRenderer

INTRINSICS = Intrinsics(320, 240, 300.0, 302.0, 158.0, 123.0)
UP = np.array([0.0, 0.0, 1.0])


def arc(count: int, degrees: float = 100.0) -> list[np.ndarray]:
    """Poses on an arc round the object at 0.9 m, rising and falling."""
    angles = np.deg2rad(np.linspace(0.0, degrees, count))
    eyes = [0.9 * np.array([np.cos(a), np.sin(a), 0.35 + 0.15 * np.sin(4 * a)]) for a in angles]
    return [look_at(eye, np.array([0.0, 0.0, 0.05]), UP) for eye in eyes]


def turns_on_the_spot(count: int, degrees: float = 60.0) -> list[np.ndarray]:
    """Poses of a camera that only turns."""
    eye = np.array([0.9, 0.0, 0.3])
    angles = np.deg2rad(np.linspace(-degrees / 2, degrees / 2, count))
    return [look_at(eye, eye + [-np.cos(a), np.sin(a), -0.2], UP) for a in angles]


def photograph(
    poses: Sequence[np.ndarray], folder: Path, intrinsics: Intrinsics = INTRINSICS
) -> list[Frame]:
    """Render the built-in scene from ``poses`` into ``folder``; frames carry the true cameras."""
    renderer = _renderer(intrinsics)
    frames = []
    for number, pose in enumerate(poses):
        camera = Camera(intrinsics, pose)
        image, _ = renderer.render_image(camera, samples_per_pixel=2, seed=number)
        path = folder / "images" / f"{number:04d}.png"
        write_image(path, image)
        frames.append(Frame(path.stem, camera, 0.1 * number, {Layer.IMAGE: path}))
    return frames


def record(
    poses: Sequence[np.ndarray], folder: Path, intrinsics: Intrinsics = INTRINSICS
) -> Capture:
    """Write a capture of the built-in scene from ``poses``: photographs, true depth and masks."""
    from reference.raycast_scenes import see

    renderer = _renderer(intrinsics)
    writer = CaptureWriter(folder, intrinsics)
    for number, pose in enumerate(poses):
        view = see(renderer, Camera(intrinsics, pose), samples=2, seed=number)
        writer.write_frame(number, FrameImages(view.image, view.depth, view.mask))
        writer.add_pose(number, pose, 0.1 * number)
    return writer.finish()


def _renderer(intrinsics: Intrinsics) -> "RaycastRenderer":
    from digs_warp.sim.config import SimulateConfig
    from digs_warp.sim.record.inputs import load_inputs
    from digs_warp.sim.record.session import prepare_session

    # The thresholds of the tests are for a wall all around, 4 m away.
    width, height = intrinsics.width, intrinsics.height
    config = SimulateConfig(
        profile="bare-matcher", frames=3, width=width, height=height, ground="none"
    )
    return prepare_session(config, load_inputs(config)).renderer
