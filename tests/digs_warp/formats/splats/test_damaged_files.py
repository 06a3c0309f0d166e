"""Some damaged files of each splat format; `python scripts/fuzz.py --kind splats` reads thousands."""

from pathlib import Path

from fuzz import fuzz, table
from fuzzing.kinds import find_kinds


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    """In a process of their own, so that a crash, a hang or too much memory is noticed."""
    kinds = find_kinds(["splats"])
    tallies = fuzz(kinds, count=15, seed=1, keep=tmp_path / "kept")
    assert not list(tmp_path.glob("kept/*")), table(tallies).text()
    ends = [each.end for outcomes in tallies.values() for each in outcomes]
    assert len(ends) == 15 * len(kinds) and {*ends} == {"read", "refused"}
