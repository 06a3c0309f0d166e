"""Structure from motion is shared between cases: its time counts where a case has it, and only there."""

from pathlib import Path

import pytest

from digs_warp.study.engine.chain import _share_sfm

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
