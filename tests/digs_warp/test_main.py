"""The end of the process of a command."""

import subprocess
import sys

PROGRAM = """
import sys
import threading
import time
from digs_warp.__main__ import program

class Kept:
    def __del__(self):
        print("taken apart")

def work():
    time.sleep(0.2)
    print("the thread is done")

kept = Kept()
threading.Thread(target=work).start()
sys.argv = ["digs-warp", {argument!r}]
program()
"""


def ran(argument: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", PROGRAM.format(argument=argument)]
    return subprocess.run(command, check=False, capture_output=True, text=True)


def test_the_process_of_a_command_waits_for_threads_and_is_not_taken_apart() -> None:
    finished = ran("--version")
    assert finished.returncode == 0
    first, last = sorted(finished.stdout.splitlines())
    assert first.startswith("digs-warp ") and last == "the thread is done"


def test_the_process_of_a_command_ends_with_its_exit_code() -> None:
    finished = ran("nonsense")
    assert finished.returncode == 2
    assert "nonsense" in finished.stderr
    assert finished.stdout == "the thread is done\n"
