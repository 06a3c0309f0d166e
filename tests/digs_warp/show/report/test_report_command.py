"""`digs-warp report`: the page of a stored reconstruction, the same as that of a run."""

import json
import shutil
from pathlib import Path

import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.data.capture import Capture
from reference.report_folder import report_on

Run = tuple[Capture, Path, Path]


@pytest.fixture
def stored(run: Run) -> Run:
    """The run, with the place of its recording in the record as 'reconstruct' leaves it."""
    capture, folder, _ = run
    record = json.loads((folder / "run.json").read_text())
    record["results"]["capture"] = str(capture.folder)
    (folder / "run.json").write_text(json.dumps(record))
    return run


def test_the_page_of_a_whole_run_is_the_same(stored: Run) -> None:
    report_on(stored)
    again = stored[2].with_name("again.html")
    assert main(["report", str(stored[1].parent), "--out", str(again)]) == EXIT_OK
    # The film is encoded again each time; the rest has no dates.
    first, second = (_without_film(path) for path in (stored[2], again))
    assert first == second


def _without_film(page: Path) -> str:
    before, _, after = page.read_text(encoding="utf-8").partition("data:video/mp4;base64,")
    return before + after.partition('"')[2]


def test_the_page_goes_into_the_folder_and_is_not_replaced(
    stored: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    _, folder, _ = stored
    assert main(["report", str(folder)]) == EXIT_OK
    page = folder / "report.html"
    assert f"{page}: " in capsys.readouterr().out and page.is_file()
    assert main(["report", str(folder)]) != EXIT_OK
    assert "add --overwrite" in capsys.readouterr().err
    assert main(["report", str(folder), "--overwrite"]) == EXIT_OK


def test_a_recording_that_has_moved_is_asked_for(
    stored: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capture, folder, _ = stored
    alone = tmp_path / "elsewhere/reconstruction"
    shutil.copytree(folder, alone)
    shutil.move(capture.folder, tmp_path / "moved")
    assert main(["report", str(alone)]) == EXIT_BAD_INPUT
    assert "name it with --capture" in capsys.readouterr().err
    assert not (alone / "report.html").exists()
    assert main(["report", str(alone), "--capture", str(tmp_path / "moved")]) == EXIT_OK
