"""Structure from motion is shared between cases, with its time; the scale is judged by the poses it gave."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.geometry.camera import Camera
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.files import write_atomically
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.engine.case import Case, with_settings
from digs_warp.study.engine.chain import (
    NOTE,
    _match_once,
    _matched,
    _matching_seconds,
    _scale_error,
    _workplace,
    _yardstick,
)
from digs_warp.study.engine.scores import OTHER_SIZES
from reference.ball_capture import ball_views, write_capture


@pytest.fixture
def matched(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Where images were matched; the matching itself is the pipeline's."""
    places: list[Path] = []

    def match_images(capture: Capture, config: SfmConfig, workspace: Path) -> None:
        time.sleep(0.2)
        places.append(workspace)
        write_atomically(workspace / "model", b"points")

    monkeypatch.setattr("digs_warp.pipeline.poses.match_images", match_images)
    return places


CAPTURE: Any = SimpleNamespace(readout_time=0.0)  # what is matched does not matter here


def case_of(**settings: Any) -> tuple[Case, ReconstructConfig]:
    case = Case({}, {"frames": 5}, {f"sfm.{name}": value for name, value in settings.items()})
    return case, with_settings(ReconstructConfig(), case.reconstruction)


def test_the_next_case_takes_the_matches_and_the_time_of_the_first(
    matched: list[Path], tmp_path: Path
) -> None:
    """Poses are refined after the matching, so that cases with and without it share theirs."""
    first, second = case_of(poses="sfm"), case_of(poses="sfm", refine_poses="off")
    for case, config in (first, second):
        work = _workplace(case, CAPTURE, config, tmp_path)
        assert (work / "sfm" / "model").read_text() == "points"
        assert 0.2 <= _matching_seconds(case, config, tmp_path) < 60
    assert len(matched) == 1
    other = case_of(poses="sfm", features=500)
    _workplace(other[0], CAPTURE, other[1], tmp_path)
    assert len(matched) == 2


def test_a_case_that_needs_no_matches_makes_none(matched: list[Path], tmp_path: Path) -> None:
    case, config = case_of(poses="capture")
    assert not _workplace(case, CAPTURE, config, tmp_path).exists()
    assert matched == []


def test_cases_at_the_same_time_match_once(matched: list[Path], tmp_path: Path) -> None:
    case, config = case_of(poses="sfm")
    with ThreadPoolExecutor(2) as pool:
        for _ in range(2):
            pool.submit(_match_once, CAPTURE, config.sfm, tmp_path / case.key)
    assert matched == [tmp_path / case.key]


def test_what_a_killed_case_had_begun_to_match_goes_on(matched: list[Path], tmp_path: Path) -> None:
    case, config = case_of(poses="sfm")
    write_atomically(_matched(case, config, tmp_path) / "half", b"")
    work = _workplace(case, CAPTURE, config, tmp_path)
    assert matched == [_matched(case, config, tmp_path)]
    assert {path.name for path in (work / "sfm").iterdir()} == {"half", "model", NOTE}


def test_the_yardstick_shows_the_same_views_at_four_sizes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    recorded: dict[str, SimulateConfig] = {}

    def record(config: SimulateConfig, key: str, folder: Path) -> SimpleNamespace:
        recorded[key] = config
        return SimpleNamespace(frames=())

    monkeypatch.setattr("digs_warp.study.engine.chain._recorded", record)
    case, _ = case_of()
    for size in ("", *OTHER_SIZES):
        _yardstick(case, tmp_path, size)
    usual, half, larger, double = recorded.values()
    assert [one.width for one in (half, usual, larger, double)] == [320, 640, 854, 1280]
    assert half.samples_per_pixel == 4 * usual.samples_per_pixel  # as many for the same surface
    sizes = {name: getattr(usual, name) for name in ("width", "height", "samples_per_pixel")}
    assert all(replace(other, **sizes) == usual for other in (half, larger, double))


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
