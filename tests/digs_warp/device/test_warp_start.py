"""Warp starts quietly: stdout is for results, stderr for what a user can use."""

import logging
import subprocess
import sys
from pathlib import Path

import pytest
import warp as wp

from digs_warp.device import warp_start


def test_loading_the_kernels_writes_nothing() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import digs_warp.device.parallel"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == ("", "")


def test_native_messages_other_than_the_missing_driver_are_passed_on() -> None:
    code = (
        "import os\n"
        "from digs_warp.device import warp_start\n"
        "with warp_start._without_driver_warning():\n"
        "    os.write(2, b'before\\n' + warp_start.NO_DRIVER + b'. No GPU.\\nafter\\n')\n"
        "os.write(2, b'later\\n')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "before\nafter\nlater\n"


def test_compiling_a_kernel_is_logged_with_its_module_and_counted(
    caplog: pytest.LogCaptureFixture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    warp_start.start_warp()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))  # nothing is compiled yet
    before = warp_start.compile_seconds()
    with caplog.at_level(logging.INFO, warp_start.logger.name):
        wp.load_module(device="cpu")
        wp.launch(_nothing_kernel, dim=1, device="cpu")
    assert [r.message.split(" in ")[0] for r in caplog.records] == [f"compiled {__name__}"]
    first = warp_start.compile_seconds() - before
    assert 0.0 < first < 60.0
    wp.load_module(device="cpu")  # there already
    assert warp_start.compile_seconds() - before == first


@wp.kernel
def _nothing_kernel():
    pass
