"""A page that shows a training while it runs."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from digs_warp.show.view.contents import Contents, Stage
from digs_warp.show.view.page import Page
from digs_warp.show.view.server import started
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.session import Watch

NAME = "training"
HOST, FIRST_PORT = "127.0.0.1", 8080

# Updates of the page take at most this share of the time, and are at least this many seconds apart.
MOST_SHARE, LEAST_SECONDS = 0.03, 1.0


@contextmanager
def live_page(say: Callable[[str], None]) -> Iterator[Watch]:
    """Yield what the training calls; the page ends with the block.

    Args:
        say: called with the page's address when the training has begun.
    """
    with ExitStack() as stack:
        yield _LiveTraining(stack, say).watch


class _LiveTraining:
    """Starts the page with the first Gaussians, which say where things stand; then keeps it up to date."""

    def __init__(self, stack: ExitStack, say: Callable[[str], None]) -> None:
        self._stack = stack
        self._say = say
        self._page: Page | None = None
        self._next = 0.0

    def watch(self, iteration: int, gaussians: DeviceGaussians) -> None:
        """Show the Gaussians of an iteration, unless that would take too much of the training's time."""
        start = time.perf_counter()
        if start < self._next:
            return
        if self._page is None:
            contents = [Contents(NAME, stages=(_stage(iteration, gaussians),))]
            self._page, address = self._stack.enter_context(started(contents, HOST, FIRST_PORT))
            self._say(address)
        elif self._page.has_visitors:
            self._page.replace_stage(_stage(iteration, gaussians))
        now = time.perf_counter()
        self._next = now + max(LEAST_SECONDS, (now - start) / MOST_SHARE)


def _stage(iteration: int, gaussians: DeviceGaussians) -> Stage:
    return Stage(f"iteration {iteration}", gaussians.to_numpy())
