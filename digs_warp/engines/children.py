"""The processes that one process makes calls in: one for each call, or one for several after each other."""

import threading
from typing import Any

from digs_warp.engines.child import Child
from digs_warp.engines.needs import Needs


class Children:
    """Child processes; those whose last call ended well are kept for the next."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[tuple[int, Child]] = []
        self._busy: set[Child] = set()
        self._is_over = False

    def run(self, call: bytes, needs: Needs) -> Any:
        """Make a call from `digs_warp.engines.child.packed` in a child and return what it returns.

        Raises:
            CallFailed: it has no result.
        """
        with self._lock:
            if self._is_over:
                raise RuntimeError("the engine was shut down")
            child = self._take(needs)
            self._busy.add(child)
        try:
            value = child.result(call, needs.seconds)
        except BaseException:
            self._end(child)
            raise
        if needs.alone:
            self._end(child)
        else:
            with self._lock:
                self._busy.discard(child)
                self._idle.append((needs.threads, child))
        return value

    def stop(self) -> None:
        """End all of them, also those that have a call; from now on there are no calls."""
        with self._lock:
            self._is_over = True
            children = [*self._busy, *(child for _, child in self._idle)]
            self._idle.clear()
        for child in children:
            child.stop()

    def _take(self, needs: Needs) -> Child:
        """Return an idle child with the right number of threads, or a new one; called with the lock."""
        self._idle = [(threads, child) for threads, child in self._idle if child.is_alive]
        for entry in self._idle:
            if entry[0] == needs.threads and not needs.alone:
                self._idle.remove(entry)
                return entry[1]
        return Child(needs.threads)

    def _end(self, child: Child) -> None:
        child.stop()
        with self._lock:
            self._busy.discard(child)


_children = Children()


def run_apart(call: bytes, needs: Needs) -> Any:
    """Make a call in a child of this process: what a worker of a cluster does. See `Children.run`."""
    return _children.run(call, needs)
