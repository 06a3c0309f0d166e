"""Structure from motion is shared between cases, with its time; the scale is judged by the poses it gave."""

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from digs_warp.data.capture import Capture
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.files import write_atomically
from digs_warp.study.engine.case import Case, with_settings
from digs_warp.study.engine.chain import (
    NOTE,
    _matched,
    _matching_seconds,
    _workplace,
)


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


def test_what_a_killed_case_had_begun_goes_on_and_who_needs_no_matches_makes_none(
    matched: list[Path], tmp_path: Path
) -> None:
    case, config = case_of(poses="capture")
    assert not _workplace(case, CAPTURE, config, tmp_path).exists()
    assert matched == []
    case, config = case_of(poses="sfm")
    write_atomically(_matched(case, config, tmp_path) / "half", b"")
    work = _workplace(case, CAPTURE, config, tmp_path)
    assert matched == [_matched(case, config, tmp_path)]
    assert {path.name for path in (work / "sfm").iterdir()} == {"half", "model", NOTE}
