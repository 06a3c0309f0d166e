"""A result knows its recording wherever the command is started: paths in records are often relative."""

from pathlib import Path

import pytest

from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.pipeline.records import find_capture

NOTED = Path("captures/mug")  # as it was given in the folder "project"


def with_index(folder: Path) -> Path:
    folder.mkdir(parents=True)
    (folder / INDEX_NAME).write_text("{}")
    return folder


@pytest.fixture
def result(tmp_path: Path) -> Path:
    folder = tmp_path / "project/results/mug"
    folder.mkdir(parents=True)
    return folder


def test_the_recording_is_found_from_another_folder(
    tmp_path: Path, result: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    capture = with_index(tmp_path / "project" / NOTED)
    monkeypatch.chdir(tmp_path)
    assert find_capture(result, NOTED) == capture
    assert find_capture(Path("project/results/mug"), NOTED) == Path("project") / NOTED
    monkeypatch.chdir(result)
    found = find_capture(Path(), NOTED)
    assert found is not None and found.samefile(capture)


def test_a_recording_beside_the_result_comes_before_a_noted_one(
    tmp_path: Path, result: Path
) -> None:
    with_index(tmp_path / "project" / NOTED)
    beside = with_index(result.parent / "capture")
    assert find_capture(result, NOTED) == beside
