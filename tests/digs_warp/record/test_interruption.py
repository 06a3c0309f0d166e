"""Signals end a command in order, and a lock lets one process at a time write a folder."""

import os
import pty
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import main
from digs_warp.record.interruption import (
    STOP_SIGNALS,
    Stopped,
    deferred_interrupt,
    stopped_by_signals,
)
from digs_warp.record.layout import LOCK
from digs_warp.record.lock import sole_writer

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


HOLD = """
import sys, time
from pathlib import Path
from digs_warp.record.lock import sole_writer
with sole_writer(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_busy_folder_is_refused_by_name_and_that_of_a_killed_process_is_free(
    tmp_path: Path, capsys
) -> None:
    words = [sys.executable, "-c", HOLD, str(tmp_path)]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    for flags in ([], ["--resume"], ["--overwrite"]):
        assert main(["simulate", "--out", str(tmp_path), *flags]) == 1
        assert f"'{tmp_path}': another run is writing to this folder" in capsys.readouterr().err
    process.kill()
    process.communicate()
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]
    with sole_writer(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_nothing_was_written_to_is_not_left_behind(tmp_path: Path) -> None:
    with sole_writer(tmp_path / "a" / "b"):
        assert (tmp_path / "a" / "b").is_dir()
    assert not (tmp_path / "a").exists()
    with sole_writer(tmp_path / "a" / "b"):
        (tmp_path / "a" / "b" / "result").touch()
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["result"]


def test_a_thread_may_lock_twice_and_two_threads_may_not(tmp_path: Path) -> None:
    found = []

    def try_it() -> None:
        try:
            with sole_writer(tmp_path):
                found.append("taken")
        except DigsError:
            found.append("refused")

    with sole_writer(tmp_path):
        with sole_writer(tmp_path):
            pass
        thread = threading.Thread(target=try_it)
        thread.start()
        thread.join()
    try_it()
    assert found == ["refused", "taken"]


def test_many_processes_take_turns(tmp_path: Path) -> None:
    """The lock is deleted and made again all the time; nobody ever shares it."""
    made = tmp_path / "made"
    code = (
        "import os, sys\nfrom pathlib import Path\n"
        "from digs_warp.record.lock import taking_turns\n"
        "for _ in range(50):\n"
        "    with taking_turns(Path(sys.argv[1])):\n"
        "        os.close(os.open(sys.argv[1], os.O_CREAT | os.O_EXCL))\n"
        "        os.unlink(sys.argv[1])\n"
    )
    processes = [subprocess.Popen([sys.executable, "-c", code, str(made)]) for _ in range(3)]
    assert [process.wait(timeout=300) for process in processes] == [0, 0, 0]
    assert not any(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DigsError, match=r"file/out': cannot be written"):
        with sole_writer(tmp_path / "file/out"):
            pass


def test_only_what_processes_left_is_removed(tmp_path: Path) -> None:
    folder = tmp_path / "sub"
    folder.mkdir()
    kept = "a.png.12.tmp .a.png.12.tmp.txt .12.tmp .a.png.x1.tmp .a.0.tmp .link.12.tmp".split()
    for name in (".a.png.12.tmp", *kept[:-1]):
        (folder / name).write_text("precious")
    (folder / ".b.12.tmp").mkdir()
    (folder / ".b.12.tmp/part").touch()
    (folder / kept[-1]).symlink_to(tmp_path)
    with sole_writer(tmp_path):
        assert sorted(path.name for path in folder.iterdir()) == sorted(kept)
