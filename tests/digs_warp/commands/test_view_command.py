"""`digs-warp view` as a process."""

import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

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
