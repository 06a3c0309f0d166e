"""Poses before a wall whose pattern repeats: images agree on wrong ones, and depth tells."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.pipeline.config import FrontEndConfig
from digs_warp.pipeline.front_end import front_end
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.refine.photometric_alignment import in_place
from digs_warp.record.run_log import RunLog
from reference.optional import open3d_or_skip

# Tiles side by side all round.
REPEATS = 16


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """An arc around the built-in object; steps are about as wide as the tiles of the wall behind it."""
    wall = tmp_path_factory.mktemp("wall") / "wall.png"
    tile = np.random.default_rng(1).uniform(40, 230, (16, 16, 3)).repeat(4, 0).repeat(4, 1)
    write_image(wall, np.tile(tile, (8, REPEATS, 1)).astype(np.uint8))
    settings = {"environment": wall, "width": 320, "tier": "law", "camera_path": "arc", "seed": 3}
    whole = dw.simulate(profile="bare-matcher", frames=20, elevations=(20.0,), **settings)
    return replace(whole, frames=whole.frames[:7])


def test_auto_takes_color_and_depth_where_images_mislead(
    capture: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    open3d_or_skip()
    lost = [replace(f, camera=replace(f.camera, world_from_cam=np.eye(4))) for f in capture.frames]
    about = replace(capture.about, poses_known=False)
    unknown = replace(capture, frames=tuple(lost), about=about)
    config = FrontEndConfig(sfm=SfmConfig(poses="auto"), test_every=4)
    with caplog.at_level(logging.WARNING):
        prepared = front_end(unknown, config, tmp_path, RunLog("test", {}))
    # What misleads them, a pattern that repeats or cameras in a line, depends on the sparse points found.
    assert "structure from motion: " in caplog.text
    assert "; trying color and depth (--poses rgbd)" in caplog.text
    assert prepared.poses.tracking is not None and prepared.poses.sfm is None
    by_time = [frame for frame, _ in prepared.poses.posed.by_time]
    found = np.stack([frame.camera.world_from_cam for frame in by_time])
    true = np.stack([frame.camera.world_from_cam for frame in capture.frames])
    moved = in_place(found, true, 0.6) - true
    assert 1000 * np.linalg.norm(moved[:, :3, 3], axis=1).max() < 5.0
    assert np.degrees(np.linalg.norm(moved[:, :3, :3], axis=(1, 2)) / np.sqrt(2.0)).max() < 0.3
