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


def test_the_page_is_that_of_the_run_and_is_not_replaced(
    stored: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    _, folder, page = stored
    report_on(stored)
    again = page.with_name("again.html")
    assert main(["report", str(folder.parent), "--out", str(again)]) == EXIT_OK
    assert again.read_bytes() == page.read_bytes()
    assert main(["report", str(folder)]) == EXIT_OK
    assert f"{folder / 'report.html'}: " in capsys.readouterr().out
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
