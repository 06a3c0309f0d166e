"""Commands with known defects, for the test of the fuzzing command: a worker process has to import them."""

import os
import signal
from collections.abc import Sequence

from digs_warp.checks import DigsError


def planted(words: Sequence[str]) -> int:
    """Do what the first word says."""
    match words[0]:
        case "read":
            return 0
        case "refused":
            return 1
        case "stop":
            raise SystemExit(2)
        case "traceback":
            raise DigsError("one that nobody turned into an exit code")
        case "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        case "memory":
            assert b"x" * (100 << 20)
        case "time":
            while True:
                pass
    return 0
