"""A small capture of random pixels, and changes to its index: what the tests of the capture folder write."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.about import About
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.rig import Rig
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import look_at

INTRINSICS = Intrinsics(12, 9, 15.0, 16.0, 6.5, 4.25)
UP = np.array([0.0, 0.0, 1.0])


def frame_images(seed: int, stereo: bool = True) -> FrameImages:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.5, 2.0, (9, 12)).astype(np.float32)
    depth[rng.random((9, 12)) < 0.2] = np.nan
    return FrameImages(
        image=rng.integers(0, 256, (9, 12, 3), dtype=np.uint8),
        depth=depth,
        mask=rng.integers(0, 256, (9, 12), dtype=np.uint8),
        right=rng.integers(0, 256, (9, 12, 3), dtype=np.uint8) if stereo else None,
        depth_true=depth + np.float32(0.25) if stereo else None,
    )


def view(number: int) -> np.ndarray:
    return look_at(np.array([np.cos(number), np.sin(number), 0.3]), np.zeros(3), UP)


def write_capture(folder: Path, count: int = 3, stereo: bool = True) -> Capture:
    writer = CaptureWriter(folder, INTRINSICS, Rig(0.12) if stereo else None)
    for number in range(count):
        writer.write_frame(number, frame_images(number, stereo))
        writer.add_pose(number, view(number), time=0.5 * number)
    return writer.finish(About(recorded_as="a test"))


def change_index(folder: Path, **changes: Any) -> None:
    """Set keys of transforms.json; a value of None removes the key."""
    path = folder / "transforms.json"
    index = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps({key: value for key, value in index.items() if value is not None}))


def change_frame(folder: Path, number: int, **changes: Any) -> None:
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    changed = {**frames[number], **changes}
    frames[number] = {key: value for key, value in changed.items() if value is not None}
    change_index(folder, frames=frames)
