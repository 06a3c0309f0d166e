"""--poses rgbd: an object in an almost white room, whose poses nobody knows."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.pipeline.config import FrontEndConfig
from digs_warp.pipeline.front_end import FrontEnd, front_end
from digs_warp.pipeline.records import Poses, stored
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.refine.photometric_alignment import in_place
from digs_warp.record.run_log import RunLog, RunRecord
from reference.optional import open3d_or_skip

CONFIG = FrontEndConfig(sfm=SfmConfig(poses="rgbd"), test_every=4)
# How far poses may be off in the median and at worst [mm], [degree]: 240 x 135 pixels, an arc of 60 degrees,
# noise of 18 mm in the depth of what is mostly 2 m away. Errors add up from frame to frame.
CENTERS_MM, TURNS_DEG = (25.0, 70.0), (1.6, 4.0)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """An arc around the built-in object; white walls, law-like depth."""
    white = tmp_path_factory.mktemp("white") / "white.png"
    across = np.cos(np.linspace(0, 2 * np.pi, 128))[None, :, None]
    pixels = np.broadcast_to(228 + 8 * across, (64, 128, 3)).astype(np.uint8)
    write_image(white, np.ascontiguousarray(pixels))
    settings = {"environment": white, "width": 240, "tier": "law", "camera_path": "arc", "seed": 2}
    whole = dw.simulate(profile="bare-matcher", frames=40, elevations=(35.0,), **settings)
    return replace(whole, frames=whole.frames[:18])


def unknown(capture: Capture) -> Capture:
    lost = [replace(f, camera=replace(f.camera, world_from_cam=np.eye(4))) for f in capture.frames]
    about = replace(capture.about, poses_known=False)
    return replace(capture, frames=tuple(lost), about=about)


def placed(prepared: FrontEnd, capture: Capture) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses of all frames, held-out ones included, and how far off they are together [mm, degree]."""
    by_time = [frame for frame, _ in prepared.poses.posed.by_time]
    assert len(by_time) == len(capture)
    found = np.stack([frame.camera.world_from_cam for frame in by_time])
    true = np.stack([frame.camera.world_from_cam for frame in capture.frames])
    off = in_place(found, true, 0.6) - true
    turns = np.degrees(np.linalg.norm(off[:, :3, :3], axis=(1, 2)) / np.sqrt(2.0))
    return found, 1000 * np.linalg.norm(off[:, :3, 3], axis=1), turns


def test_hidden_poses_are_found_and_the_record_says_how_well_they_fit(
    capture: Capture, tmp_path: Path
) -> None:
    open3d_or_skip()
    # So few features are not enough for images alone.
    few = SfmConfig(poses="auto", features=50, feature_size=120, double_size=False)
    config = replace(CONFIG, sfm=few)
    prepared = front_end(unknown(capture), config, tmp_path, RunLog("test", {}))
    assert prepared.poses.sfm is None
    found, apart, turns = placed(prepared, capture)
    assert np.median(apart) < CENTERS_MM[0] and apart.max() < CENTERS_MM[1]
    assert np.median(turns) < TURNS_DEG[0] and turns.max() < TURNS_DEG[1]
    # z is up in the images; the origin is in the middle of what is seen.
    assert (found[:, 2, 1] < -0.5).all()
    low, high = prepared.start.points.bounds
    assert (low < 0.3).all() and (high > -0.3).all()
    assert prepared.poses.tracking is not None and prepared.poses.tracking.loops > 0
    # What color and depth leave, the training takes off.
    assert prepared.poses.refinement is not None
    assert prepared.poses.refinement.in_training and not prepared.poses.refinement.refined
    record = RunRecord.find(tmp_path)
    assert record is not None
    assert stored(Poses, record, tmp_path).tracking == prepared.poses.tracking


# Tiles side by side all round.
REPEATS = 16


@pytest.fixture(scope="module")
def repeating(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """An arc around the built-in object; steps are about as wide as the tiles of the wall behind it."""
    wall = tmp_path_factory.mktemp("wall") / "wall.png"
    tile = np.random.default_rng(1).uniform(40, 230, (16, 16, 3)).repeat(4, 0).repeat(4, 1)
    write_image(wall, np.tile(tile, (8, REPEATS, 1)).astype(np.uint8))
    settings = {"environment": wall, "width": 320, "tier": "law", "camera_path": "arc", "seed": 3}
    whole = dw.simulate(profile="bare-matcher", frames=20, elevations=(20.0,), **settings)
    return replace(whole, frames=whole.frames[:7])


def test_auto_takes_color_and_depth_where_images_mislead(
    repeating: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    open3d_or_skip()
    config = FrontEndConfig(sfm=SfmConfig(poses="auto"), test_every=4)
    with caplog.at_level(logging.WARNING):
        prepared = front_end(unknown(repeating), config, tmp_path, RunLog("test", {}))
    # What misleads them, a pattern that repeats or cameras in a line, depends on the sparse points found.
    assert "structure from motion: " in caplog.text
    assert "; trying color and depth (--poses rgbd)" in caplog.text
    assert prepared.poses.tracking is not None and prepared.poses.sfm is None
    _, apart, turns = placed(prepared, repeating)
    assert apart.max() < 5.0 and turns.max() < 0.3
