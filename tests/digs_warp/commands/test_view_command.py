"""`digs-warp view` as a process, and `--view`, which shows a training without changing its result."""

import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np

from digs_warp.cli import EXIT_OK, main
from digs_warp.data.gaussians import Gaussians
from reference.tiny_capture import ball, write_tiny_capture


def test_it_serves_its_page_until_it_is_interrupted(tmp_path: Path) -> None:
    ball().save(tmp_path / "ball.npz")
    process = subprocess.Popen(
        [sys.executable, "-m", "digs_warp", "view", str(tmp_path / "ball.npz")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    address = process.stdout.readline().split()[0]
    assert address.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(address) as answer:
        page = answer.read().decode()
    assert "<html" in page
    assert "https://" not in page.replace("https://opengraph", "")  # nothing from the network
    process.send_signal(signal.SIGTERM)  # SIGINT is ignored in processes of a shell's background
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out.strip(), err) == (0, "closed", "")


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
