"""What importing a library must not change in the process."""

import signal
import subprocess
import sys

import pytest

# "{before}" sets what happens on SIGTERM before the library comes.
PROGRAM = """
import os, signal, sys
from digs_warp.device.libraries import import_pycolmap
{before}
import_pycolmap()
os.kill(os.getpid(), signal.SIGTERM)
"""
IN_ORDER = "signal.signal(signal.SIGTERM, lambda *_: sys.exit(7))"


@pytest.mark.parametrize(("before", "status"), [("", -signal.SIGTERM), (IN_ORDER, 7)])
def test_a_process_with_pycolmap_still_ends_as_it_would_without(before: str, status: int) -> None:
    program = PROGRAM.format(before=before)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (status, "")
