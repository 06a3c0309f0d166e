"""`python -m digs_warp` is `digs-warp`."""

import atexit
import gc
import os
import sys
from typing import NoReturn


def program() -> NoReturn:
    """Run the command line of this process, and end the process with its exit code.

    Nothing is imported before the exit handler is registered: so it runs last, after those of all libraries,
    and after all threads. What is imported stays, and looking for garbage in it took a quarter of a second.
    """
    gc.set_threshold(50_000, 50)
    codes: list[int] = []
    atexit.register(_leave, codes)
    from digs_warp.cli import main

    codes.append(main())
    sys.exit(codes[0])


def _leave(codes: list[int]) -> None:
    """End the process at once: taking apart all that was imported would keep a core for half a second.

    Without a code, an error of the program ended it, and Python knows the code.
    """
    if codes:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(codes[0])


if __name__ == "__main__":
    program()
