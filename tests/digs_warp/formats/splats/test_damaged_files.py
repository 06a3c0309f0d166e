"""Some damaged files of each splat format; `python scripts/fuzz.py --kind splats` reads thousands."""

import zipfile
from pathlib import Path

import pytest
from fuzz import fuzz, table
from fuzzing.kinds import find_kinds

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from reference.splat_scenes import random_gaussians


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    """In a process of their own, so that a crash, a hang or too much memory is noticed."""
    kinds = find_kinds(["splats"])
    tallies = fuzz(kinds, count=15, seed=1, keep=tmp_path / "kept")
    assert not list(tmp_path.glob("kept/*")), table(tallies).text()
    ends = [each.end for outcomes in tallies.values() for each in outcomes]
    assert len(ends) == 15 * len(kinds) and {*ends} == {"read", "refused"}


def test_an_entry_that_is_no_array_is_an_error(tmp_path: Path) -> None:
    random_gaussians(3, 0).save(tmp_path / "a.npz")
    with (
        zipfile.ZipFile(tmp_path / "a.npz") as old,
        zipfile.ZipFile(tmp_path / "b.npz", "w") as new,
    ):
        for name in old.namelist():
            new.writestr(name.removesuffix(".npy"), b"no array")
    with pytest.raises(DigsError, match=r"b\.npz'.*expected an \.npz with means"):
        Gaussians.load(tmp_path / "b.npz")
