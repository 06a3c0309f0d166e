"""What `make release` does before and after the long part: notes, a clean tree."""

from pathlib import Path

import pytest
from release import git, notes_of, require_clean

from digs_warp.checks import DigsError

CHANGELOG = """# Changelog

## [Unreleased]

- What comes.

## [0.2.0] - 2026-01-02

### Train

- Faster.

## [0.1.0] - 2025-01-02

- First.
"""


def test_notes_are_the_section_of_the_version_or_what_comes() -> None:
    assert notes_of(CHANGELOG, "0.2.0") == ("0.2.0", "### Train\n\n- Faster.\n")
    assert notes_of(CHANGELOG, "0.1.0") == ("0.1.0", "- First.\n")
    assert notes_of(CHANGELOG, "0.3.0") == ("Unreleased", "- What comes.\n")
    for changelog in ("", "# Changelog\n\n## [Unreleased]\n\n## [0.1.0]\n\n- First.\n"):
        with pytest.raises(DigsError, match=r"no text under '## \[0\.2\.0\]'"):
            notes_of(changelog, "0.2.0")


def test_files_that_differ_from_the_last_commit_are_named(tmp_path: Path) -> None:
    git(tmp_path, "init", "--quiet")
    require_clean(tmp_path)
    (tmp_path / "forgotten.py").touch()
    with pytest.raises(DigsError, match=r"'forgotten\.py' is not as in the last commit"):
        require_clean(tmp_path)
