"""Structure from motion is shared between cases, with its time; the scale is judged by the poses it gave."""

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.camera import Camera
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.sfm.config import SfmConfig
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.chain import _one_matches, _scale_error, _share_sfm, start_of_case
from reference.ball_capture import ball_views, write_capture

STAGE = "structure from motion"


@pytest.fixture
def shared(tmp_path: Path) -> Path:
    """What a first case leaves for those with the same settings."""
    (tmp_path / "first" / "sfm").mkdir(parents=True)
    (tmp_path / "first" / "sfm" / "model").write_text("points")
    _share_sfm(tmp_path / "first", tmp_path / "shared", {STAGE: 12.5})
    return tmp_path / "shared"


def test_the_next_case_counts_the_time_of_the_first(shared: Path, tmp_path: Path) -> None:
    seconds = {STAGE: 0.1, "train": 3.0}  # read from what is shared
    _share_sfm(tmp_path / "next", shared, seconds)
    assert seconds == {STAGE: 12.5, "train": 3.0}
    assert (shared / "model").read_text() == "points"


def test_a_case_without_the_stage_does_not_count_it(shared: Path, tmp_path: Path) -> None:
    seconds = {"train": 3.0}
    _share_sfm(tmp_path / "next", shared, seconds)
    assert seconds == {"train": 3.0}


@pytest.mark.parametrize("shares", [True, False])
def test_cases_that_share_structure_from_motion_wait_for_the_first(
    tmp_path: Path, shares: bool
) -> None:
    config = ReconstructConfig(sfm=SfmConfig(poses="sfm" if shares else "capture"))
    work, matched = tmp_path / "first", tmp_path / "sfm" / "shared"
    (work / "sfm").mkdir(parents=True)
    found_by_second = []
    entered = threading.Event()

    def second() -> None:
        with _one_matches(config, matched):
            found_by_second.append(matched.is_dir())
            entered.set()

    with _one_matches(config, matched):
        thread = threading.Thread(target=second)
        thread.start()
        entered.wait(0.5 if shares else 60.0)
        _share_sfm(work, matched, {STAGE: 12.5})
    thread.join()
    assert found_by_second == [shares]


def test_what_a_killed_case_had_begun_to_share_is_not_taken(tmp_path: Path) -> None:
    (tmp_path / "work" / "sfm").mkdir(parents=True)
    matched = tmp_path / "shared"
    matched.mkdir()
    (matched / "half").touch()
    _share_sfm(tmp_path / "work", matched, {STAGE: 1.0})
    assert [path.name for path in matched.iterdir()] == ["study.json"]


@pytest.mark.parametrize("factor", [1.0, 1.03, 0.98])
def test_the_scale_error_of_estimated_poses_is_that_of_their_size(
    tmp_path: Path, factor: float
) -> None:
    capture = write_capture(tmp_path, ball_views(5))
    moved = []
    for frame in capture.frames:
        world_from_cam = frame.camera.world_from_cam.copy()
        world_from_cam[:3, 3] = factor * world_from_cam[:3, 3] + np.array([0.1, -2.0, 0.4])
        moved.append(replace(frame, camera=Camera(frame.camera.intrinsics, world_from_cam)))
    posed = PosedFrames(tuple(moved[1:]), (moved[0],))
    config = ReconstructConfig(sfm=SfmConfig(poses="sfm"))
    assert _scale_error(capture, config, posed) == pytest.approx(abs(factor - 1), abs=1e-9)


def test_the_start_of_a_case_is_what_its_training_would_begin_with(tmp_path: Path) -> None:
    small = {"frames": 5, "width": 96, "height": 54, "samples_per_pixel": 1, "tier": "law"}
    case = Case({"object": "vase"}, small, {"init.voxel_size": 0.02})
    capture, frames, points = start_of_case(case, tmp_path)
    assert len(capture) == 5 and len(frames.held_out) == 1
    expected = initial_points(frames.training, InitConfig(voxel_size=0.02))
    np.testing.assert_array_equal(points.points_world, expected.points_world)
    assert not list((tmp_path / "work").iterdir())
    assert start_of_case(case, tmp_path)[0].folder == capture.folder
