"""Every example runs from beginning to end, at a tiny size; each is short."""

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parent.parent / "examples").glob("*.py"))
SIZE = ["96", "6"]  # width of the images and number of frames


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_the_example_runs(
    example: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if "torch" in example.stem:
        pytest.importorskip("torch", reason="torch is not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(example), *SIZE])
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out


def test_the_examples_are_few_numbered_and_short() -> None:
    assert 1 <= len(EXAMPLES) <= 8
    assert [int(path.name[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
    assert max(len(path.read_text().splitlines()) for path in EXAMPLES) < 60
