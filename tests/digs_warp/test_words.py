"""Words of messages: counts agree with their nouns, and unknown names bring the nearest known one."""

import re
from pathlib import Path

import pytest

from digs_warp.cli import main
from digs_warp.measure.scores import Scores, ViewScore
from digs_warp.words import counted, did_you_mean

REPOSITORY = Path(__file__).resolve().parents[2]
COUNTED = "views?|frames?|cases?|scenes?|results?|Gaussians?|captures?|questions?|triangles?"


def test_one_thing_is_singular() -> None:
    assert [counted(n, "view") for n in (0, 1, 2)] == ["0 views", "1 view", "2 views"]
    assert (counted(1, "entry", "entries"), counted(1000, "entry", "entries")) == (
        "1 entry",
        "1,000 entries",
    )
    assert str(Scores.of([ViewScore(psnr_object=20.0, ssim_object=0.5, name="0")])).endswith(
        "in 1 held-out view"
    )


def test_every_message_with_a_count_uses_the_helper() -> None:
    """ "3 of 8 frames" is fine; "1 frames" is not."""
    pattern = re.compile(rf"(?<!of )(?<!all )\{{len\([^{{}}]*\)(:,)?\}} (held-out )?({COUNTED})\b")
    folders = (REPOSITORY / name for name in ("digs_warp", "sim", "usd"))
    for path in (path for folder in folders for path in folder.rglob("*.py")):
        assert not pattern.search(path.read_text(encoding="utf-8")), path


def test_a_misspelled_name_brings_the_nearest_one_and_what_there_is() -> None:
    assert did_you_mean("tmu", ["tum", "bop"]) == "; did you mean 'tum'? (expected one of tum, bop)"
    assert did_you_mean("zzz", ["tum", "bop"]) == "; expected one of tum, bop"
    many = ["tum", *(f"form{number}" for number in range(50))]
    assert did_you_mean("tmu", many) == "; did you mean 'tum'?"


LONG = "n" * 3000


def ply(folder: Path) -> Path:
    path = folder / "a.ply"
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex {LONG}\nend_header\n")
    return path


def test_names_of_files_are_cut_in_messages(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = ply(tmp_path)
    assert main(["info", str(path)]) == 1
    said = capsys.readouterr().err
    assert "nnn..." in said and len(said) < 500 + 2 * len(str(path))
