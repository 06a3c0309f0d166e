"""A tiny capture for the tests of the commands."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.rig import Rig
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import look_at

WIDTH, HEIGHT = 32, 24


@pytest.fixture
def capture_folder(tmp_path: Path) -> Path:
    """Three tiny frames: half of every image is object, a quarter has no depth."""
    k = Intrinsics(WIDTH, HEIGHT, fx=30.0, fy=30.0, cx=16.0, cy=12.0)
    writer = CaptureWriter(tmp_path / "capture", k, Rig(baseline=0.12))
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[:, : WIDTH // 2] = 255
    depth = np.full((HEIGHT, WIDTH), 0.8, np.float32)
    depth[: HEIGHT // 4] = np.nan
    image = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    for number in range(3):
        writer.write_frame(number, FrameImages(image=image, depth=depth, mask=mask))
        eye = np.array([0.8, 0.1 * number, 0.2])
        writer.add_pose(number, look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])), number / 2)
    return writer.finish().folder
