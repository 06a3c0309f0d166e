"""Commands that write, on disks that run full; `scripts/full_disk.py` tries all of them at every write."""

from pathlib import Path

import pytest
from full_disk import table
from full_disks.cases import find_cases, make_inputs
from full_disks.disk import MountError, small_disk
from full_disks.walk import Walked, try_limits, try_sizes

CASES = find_cases(
    [
        *("simulate", "reconstruct", "render, .mp4", "render, images"),
        *("convert, .spz", "convert --to colmap", "export-usd, .usdz"),
    ]
)
SHARES = (0.0, 0.4, 0.9)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_inputs(tmp_path_factory.mktemp("inputs"), CASES)


def may_mount(folder: Path) -> bool:
    try:
        with small_disk(folder, 4096):
            return True
    except MountError:
        return False


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_full_disk_is_told_and_with_room_the_result_is_the_same(
    inputs: Path, tmp_path: Path, case
) -> None:
    attempt = try_sizes if may_mount(tmp_path / "disk") else try_limits
    walked = attempt(case, inputs, tmp_path / "disk", SHARES)
    assert walked.defects == []
    assert walked.runs and walked.files


def test_the_table_counts_and_keeps_the_rows_of_other_commands() -> None:
    before = table({"simulate": Walked(3, {"x", "y"}, []), "reconstruct": Walked(9, {"x"}, [])})
    after = table({"reconstruct": Walked(2, {"z"}, ["wrong"])}, before)
    rows = [row.split("|")[1:-1] for row in after.splitlines()[2:]]
    assert [[cell.strip() for cell in row] for row in rows] == [
        ["simulate", "3", "2", "0"],
        ["reconstruct", "2", "1", "1"],
        ["all", "5", "", "1"],
    ]
