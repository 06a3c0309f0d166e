"""Long calls into COLMAP that Ctrl-C can stop and whose progress can be watched."""

import threading
from collections.abc import Callable
from typing import Any, TypeVar

Result = TypeVar("Result")

POLL_SECONDS = 0.2


def run_interruptible(
    call: Callable[[], Result], cancel: Callable[[], Any], watch: Callable[[], Any] = lambda: None
) -> Result:
    """Run ``call`` on a separate thread and return its result.

    Python handles Ctrl-C on the main thread only when that one runs Python code, and a call into COLMAP
    takes minutes; so the main thread waits here.

    Args:
        call: the work; it must release the interpreter lock while it computes.
        cancel: asks ``call`` to return soon; called on Ctrl-C, which is raised once ``call`` has returned:
            what it writes is then whole.
        watch: called several times a second meanwhile, and once at the end.
    """
    results: list[Result] = []
    errors: list[BaseException] = []

    def work() -> None:
        try:
            results.append(call())
        except BaseException as error:  # raised again below, on the caller's thread
            errors.append(error)

    thread = threading.Thread(target=work, name="colmap")
    thread.start()
    try:
        while thread.is_alive():
            thread.join(POLL_SECONDS)
            watch()
    except BaseException:
        cancel()
        thread.join()
        raise
    watch()
    if errors:
        raise errors[0]
    return results[0]
