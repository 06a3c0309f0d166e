"""`digs-warp view` as a process: it says where it is, and ends in order."""

import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_WRONG_USAGE, main
from reference.tiny_capture import ball


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


def test_what_cannot_be_shown_is_told(tmp_path: Path, capsys) -> None:
    assert main(["view", str(tmp_path / "nothing")]) == EXIT_BAD_INPUT
    assert "no such file or folder" in capsys.readouterr().err
    assert main(["view"]) == EXIT_WRONG_USAGE
    ball().save(tmp_path / "ball.npz")
    assert main(["view", str(tmp_path / "ball.npz"), "--host", "192.0.2.1"]) == EXIT_BAD_INPUT
    assert "an address of this machine" in capsys.readouterr().err
