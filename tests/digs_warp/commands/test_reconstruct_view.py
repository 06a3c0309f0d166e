"""`--view` shows a training and changes nothing about its result."""

from pathlib import Path

import numpy as np

from digs_warp.cli import EXIT_OK, main
from digs_warp.data.gaussians import Gaussians
from reference.tiny_capture import write_tiny_capture


def test_a_watched_training_ends_with_the_same_bits(tmp_path: Path, capsys) -> None:
    write_tiny_capture(tmp_path / "capture")
    words = ["reconstruct", str(tmp_path / "capture"), "--iterations", "20", "--quiet"]
    assert main([*words, "--out", str(tmp_path / "plain")]) == EXIT_OK
    assert "http://" not in capsys.readouterr().err
    assert main([*words, "--out", str(tmp_path / "watched"), "--view"]) == EXIT_OK
    assert "http://127.0.0.1:" in capsys.readouterr().err
    plain, watched = (
        Gaussians.load(tmp_path / name / "gaussians.npz") for name in ("plain", "watched")
    )
    for name, values in vars(plain).items():
        np.testing.assert_array_equal(values, getattr(watched, name))
