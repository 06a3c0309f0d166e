"""Poses from images before a wall whose pattern repeats: images agree on wrong ones, and depth tells."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.pipeline.front_end import FrontEndConfig, Prepared, front_end
from digs_warp.poses.align import in_place
from digs_warp.poses.chain import turn_deg
from digs_warp.poses.contradiction import Contradiction, contradiction
from digs_warp.record.run_log import RunLog
from digs_warp.sfm.config import SfmConfig
from reference.optional import open3d_or_skip

# Tiles side by side all round.
REPEATS = 16


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """An arc around the built-in object; steps are about as wide as the tiles of the wall behind it."""
    wall = tmp_path_factory.mktemp("wall") / "wall.png"
    tile = np.random.default_rng(1).uniform(40, 230, (16, 16, 3)).repeat(4, 0).repeat(4, 1)
    write_image(wall, np.tile(tile, (8, REPEATS, 1)).astype(np.uint8))
    settings = {"environment": wall, "width": 320, "tier": "law", "path": "arc", "seed": 3}
    whole = dw.simulate(frames=20, elevations=(20.0,), **settings)
    return replace(whole, frames=whole.frames[:12])


def unknown(capture: Capture) -> Capture:
    lost = [replace(f, camera=replace(f.camera, world_from_cam=np.eye(4))) for f in capture.frames]
    about = replace(capture.about, poses_known=False)
    return replace(capture, frames=tuple(lost), about=about)


def errors_deg(prepared: Prepared, capture: Capture) -> np.ndarray:
    poses = np.stack([frame.camera.world_from_cam for frame, _ in prepared.frames.by_time])
    true = np.stack([frame.camera.world_from_cam for frame in capture.frames])
    moved = np.linalg.inv(in_place(poses, true, 0.6)) @ true
    return np.array([turn_deg(each) for each in moved])


def test_depth_contradicts_the_poses_on_which_images_agree(
    capture: Capture, tmp_path: Path
) -> None:
    open3d_or_skip()
    config = FrontEndConfig(sfm=SfmConfig(), test_every=4)
    misled = front_end(unknown(capture), config, tmp_path, RunLog("test", config))
    assert misled.sfm is not None and misled.sfm.registered == len(capture)
    assert np.median(errors_deg(misled, capture)) > 10
    assert any("color and depth show another motion" in doubt for doubt in misled.doubts)


def test_true_poses_are_not_contradicted(capture: Capture) -> None:
    open3d_or_skip()
    assert contradiction(capture.frames[:6], 0.0) == Contradiction(5, 0)
