"""From where the report shows the Gaussians: a turn around the object, or along the recorded path."""

import base64
import logging
import tempfile
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.film.camera_path import (
    along,
    find_framed_subject,
    orbit,
    same_width_of_view,
    up_of,
)
from digs_warp.show.film.video import shoot, write_video

logger = logging.getLogger(__name__)

# A film of four seconds and half a megabyte.
FRAMES, FRAME_RATE = 48, 12.0
WIDTH = 400
FOV_DEG = 45.0


@dataclass(frozen=True, eq=False)
class Shot:
    """What the report's film and its 3D view show.

    Attributes:
        cameras: of the film; the 3D view begins at the first one.
        target: what the first camera looks at [m], shape (3,).
        up: what is up in the world, of length 1, shape (3,).
        is_turn: the cameras turn around the target; else they follow the recording.
    """

    cameras: list[Camera]
    target: np.ndarray
    up: np.ndarray
    is_turn: bool


@dataclass(frozen=True)
class Film:
    """A film: its data URI, which may still be in the making, and its first frame.

    Attributes:
        encoded: waits for the data URI.
        first: sRGB, shape (height, width, 3), uint8.
    """

    encoded: Callable[[], str]
    first: np.ndarray


def plan_shot(result: Reconstruction, frames: list[Frame]) -> Shot:
    """Return the shot of a reconstruction with at least one Gaussian; ``frames``: by time, at least one."""
    recorded = [frame.camera for frame in frames]
    up = up_of(recorded)
    k = recorded[0].intrinsics
    width = min(WIDTH, k.width // 4 * 4) or 4
    height = max(2, width * 3 // 8 * 2)
    if result.poses.subject == "scene":
        poses = [camera.world_from_cam for camera in evenly(recorded, FRAMES)]
        # By number: times can stand still, and only the path is shown.
        path = along(poses, range(len(poses)), same_width_of_view(k, width, height), FRAMES)
        return Shot(path, _ahead(result, path[0]), up, is_turn=False)
    subject = find_framed_subject(result.gaussians)
    turn = orbit(subject, Intrinsics.from_fov(width, height, FOV_DEG), FRAMES, up=up)
    # From the side that was recorded first: the other one may not have been seen.
    away = recorded[0].center_world - subject.center_world
    facing = [float(away @ (camera.center_world - subject.center_world)) for camera in turn]
    first = int(np.argmax(facing))
    return Shot(turn[first:] + turn[:first], subject.center_world, up, is_turn=True)


def _ahead(result: Reconstruction, camera: Camera) -> np.ndarray:
    """Return the point on the optical axis that is as far as the middle of what the camera sees."""
    px, depth = camera.project(result.gaussians.means.astype(np.float64))
    k = camera.intrinsics
    seen = (depth > 0) & (px > 0).all(axis=1) & (px < [k.width, k.height]).all(axis=1)
    distance = float(np.median(depth[seen])) if seen.any() else 1.0
    return camera.center_world + distance * camera.world_from_cam[:3, 2]


def make_film(result: Reconstruction, shot: Shot, background: Executor) -> Film:
    """Render the film of a shot on all cores, and encode it in the background."""
    frames = list(shoot(result.gaussians, shot.cameras, center_world=shot.target))
    return Film(background.submit(_encoded, frames).result, frames[0])


def _encoded(frames: list[np.ndarray]) -> str:
    """Return the film as a data URI; empty, so that its first frame stands, without the package av.

    Raises:
        DigsError: the video cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        try:
            write_video(path, frames, FRAME_RATE)
        except ImportError as error:
            logger.warning(
                "a picture instead of the film: %s; install it with: pip install av", error
            )
            return ""
        data = base64.b64encode(path.read_bytes()).decode("ascii")
    return f"data:video/mp4;base64,{data}"
