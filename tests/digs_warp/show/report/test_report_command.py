"""`digs-warp report`: the page of a stored reconstruction, the same as that of a run."""

import shutil
from pathlib import Path

import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.data.capture import Capture
from reference.report_folder import report_on

Run = tuple[Capture, Path, Path]


def test_the_page_is_that_of_the_run_and_is_not_replaced(
    run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    _, folder, page = run
    report_on(run)
    again = page.with_name("again.html")
    assert main(["report", str(folder.parent), "--out", str(again)]) == EXIT_OK
    assert again.read_bytes() == page.read_bytes()
    assert main(["report", str(folder)]) == EXIT_OK
    assert f"{folder / 'report.html'}: " in capsys.readouterr().out
    assert main(["report", str(folder)]) != EXIT_OK
    assert "add --overwrite" in capsys.readouterr().err
    assert main(["report", str(folder), "--overwrite"]) == EXIT_OK


def test_a_recording_that_has_moved_is_asked_for(
    run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capture, folder, _ = run
    alone = tmp_path / "elsewhere/reconstruction"
    shutil.copytree(folder, alone)
    shutil.move(capture.folder, tmp_path / "moved")
    assert main(["report", str(alone)]) == EXIT_BAD_INPUT
    assert "name it with --capture" in capsys.readouterr().err
    assert not (alone / "report.html").exists()
    assert main(["report", str(alone), "--capture", str(tmp_path / "moved")]) == EXIT_OK
