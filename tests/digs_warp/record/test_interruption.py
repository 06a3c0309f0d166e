"""Signals: a command ends in order; a library leaves them alone; ignored ones stay ignored."""

import os
import pty
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from digs_warp.record.interruption import (
    STOP_SIGNALS,
    Stopped,
    deferred_interrupt,
    stopped_by_signals,
)

pytestmark = pytest.mark.usefixtures("hangups_end_a_process")

# A command that waits, and says on stderr and in a file that it could still save something.
WAITING = """
import sys, time
from pathlib import Path
from digs_warp import cli
from digs_warp.commands.info import Info

def wait(command):
    try:
        command.path.write_text("waiting")
        time.sleep(600)
    finally:
        print("saving", file=sys.stderr, flush=True)
        command.path.write_text("saved")

Info.execute = wait
sys.exit(cli.main(["info", sys.argv[1]]))
"""


def wait_for(note: Path, process: "subprocess.Popen[bytes]") -> None:
    deadline = time.monotonic() + 120
    while not (note.is_file() and note.read_text() == "waiting"):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_a_signal_interrupts_like_ctrl_c_or_waits_for_the_block_once(
    number: signal.Signals,
) -> None:
    before = signal.getsignal(number)
    with pytest.raises(Stopped, match=number.name) as stopped, stopped_by_signals():
        signal.raise_signal(number)
    assert stopped.value.number == number
    assert isinstance(stopped.value, KeyboardInterrupt)
    assert signal.getsignal(number) is before
    with pytest.raises(Stopped), stopped_by_signals():
        with deferred_interrupt() as interruption:
            signal.raise_signal(number)
            assert interruption.asked == number
            with pytest.raises(Stopped):
                signal.raise_signal(number)
        interruption.end()


def test_an_ignored_signal_stays_ignored() -> None:
    """What `nohup` promises."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stopped_by_signals(), deferred_interrupt() as interruption:
            signal.raise_signal(signal.SIGHUP)
        assert interruption.asked is None
    finally:
        signal.signal(signal.SIGHUP, before)


def test_other_threads_change_no_handler() -> None:
    def look() -> list[object]:
        with stopped_by_signals(), deferred_interrupt():
            return [signal.getsignal(number) for number in STOP_SIGNALS]

    with ThreadPoolExecutor(1) as pool:
        seen = pool.submit(look).result()
    assert seen == [signal.getsignal(number) for number in STOP_SIGNALS]


def test_the_exit_code_names_the_signal(tmp_path: Path) -> None:
    note = tmp_path / "note"
    process = subprocess.Popen([sys.executable, "-c", WAITING, str(note)], stderr=subprocess.PIPE)
    wait_for(note, process)
    process.terminate()
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 128 + signal.SIGTERM
    assert b"interrupted by SIGTERM. Nothing was written." in errors
    assert note.read_text() == "saved"


def test_a_closed_terminal_does_not_keep_a_command_from_saving(tmp_path: Path) -> None:
    """Writing to a terminal that is gone fails; the command has something to save after that."""
    note = tmp_path / "note"
    master, slave = pty.openpty()
    process = subprocess.Popen(
        # setsid --ctty: the kernel sends SIGHUP when the terminal closes.
        ["setsid", "--ctty", "--wait", sys.executable, "-c", WAITING, str(note)],
        stdin=slave,
        stdout=slave,
        stderr=slave,
    )
    os.close(slave)
    wait_for(note, process)
    os.close(master)
    process.wait(timeout=120)
    assert note.read_text() == "saved"
    assert process.returncode == 129
