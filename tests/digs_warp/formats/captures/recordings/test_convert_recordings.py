"""Recordings become captures by the command."""

from pathlib import Path

import pytest

from digs_warp.cli import main
from digs_warp.data.capture import Capture, read_capture
from digs_warp.formats.captures.formats import export_capture
from reference.recorded import check_same


def test_the_command_converts_a_recording(
    capture: Capture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    arguments = ["convert", str(tmp_path / "tum"), "--from", "tum", "--out", str(tmp_path / "c")]
    assert main(arguments) == 0
    assert "3 frames from tum" in capsys.readouterr().out
    check_same(read_capture(tmp_path / "c"), capture, 2e-4)
    assert main(arguments) == 1
    assert "not empty" in capsys.readouterr().err
    assert main([*arguments, "--overwrite"]) == 0


def test_the_command_says_when_poses_are_unknown(
    capture: Capture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    (tmp_path / "tum/groundtruth.txt").unlink()
    assert (
        main(["convert", str(tmp_path / "tum"), "--out", str(tmp_path / "c"), "--from", "tum"]) == 0
    )
    assert "poses unknown" in capsys.readouterr().out
