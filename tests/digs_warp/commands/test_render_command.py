"""`digs-warp render`: a film of whatever holds Gaussians."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from reference.tiny_capture import ball, write_tiny_capture

SMALL = ["--width", "64", "--height", "48", "--seconds", "0.1"]


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    ball().save(tmp_path / "reconstruction/gaussians.npz")
    return tmp_path / "reconstruction"


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str]:
    code = main(["render", *map(str, arguments), *SMALL])
    out, err = capsys.readouterr()
    return code, out + err


def test_a_video_and_how_fast_it_was(tmp_path: Path, scene: Path, capsys) -> None:
    code, text = run(capsys, scene, "--out", tmp_path / "a.mp4")
    assert code == EXIT_OK, text
    assert "3 frames of 64x48 px, 1,500 Gaussians" in text
    assert "frames/s" in text
    assert (tmp_path / "a.mp4").is_file()
    assert run(capsys, scene, "--out", tmp_path / "a.mp4")[0] == EXIT_BAD_INPUT
    assert run(capsys, scene, "--out", tmp_path / "a.mp4", "--overwrite")[0] == EXIT_OK


def test_what_cannot_be_filmed_is_said(tmp_path: Path, scene: Path, capsys) -> None:
    for name, flags, message in [
        ("a.avi", [], "suffix '.avi', expected .mp4 or .gif"),
        ("a.mp4", ["--follow", "none"], "no such folder"),
    ]:
        code, text = run(capsys, scene, "--out", tmp_path / name, *flags)
        assert (code, message in text) == (EXIT_BAD_INPUT, True), text
        assert not list(tmp_path.glob("a.*"))


def test_along_the_path_of_a_capture(tmp_path: Path, scene: Path, capsys) -> None:
    """The first frame of the film is the first photograph, but for the size."""
    capture = write_tiny_capture(tmp_path / "capture", frames=4)
    code, text = run(
        capsys,
        *(scene, "--out", tmp_path / "film.mp4", "--follow", tmp_path / "capture"),
        *("--background", 0, 0, 0),
    )
    assert code == EXIT_OK, text
    film = cv2.VideoCapture(str(tmp_path / "film.mp4")).read()[1][..., ::-1].astype(float)
    photograph = capture.frames[0].load_image()  # 72 x 54
    rows = ((np.arange(48) + 0.5) * 54 / 48).astype(int)
    columns = ((np.arange(64) + 0.5) * 72 / 64).astype(int)
    mask = capture.frames[0].load_mask()[rows][:, columns] > 250
    assert np.abs(film - photograph[rows][:, columns])[mask].mean() < 12
