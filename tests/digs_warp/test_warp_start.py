"""Warp starts quietly: stdout is for results, stderr for what a user can use."""

import subprocess
import sys


def test_loading_the_kernels_writes_nothing() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import digs_warp.parallel"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == ("", "")


def test_native_messages_other_than_the_missing_driver_are_passed_on() -> None:
    code = (
        "import os\n"
        "from digs_warp import warp_start\n"
        "with warp_start._without_driver_warning():\n"
        "    os.write(2, b'before\\n' + warp_start.NO_DRIVER + b'. No GPU.\\nafter\\n')\n"
        "os.write(2, b'later\\n')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "before\nafter\nlater\n"
