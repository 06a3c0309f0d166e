"""Starts and ends the server of a page, also of one that shows a training while it runs."""

import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stdout
from io import StringIO

from digs_warp.checks import DigsError
from digs_warp.show.view.contents import Contents, Stage
from digs_warp.show.view.page import Page
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.session import Watch


@contextmanager
def started(contents: Sequence[Contents], host: str, port: int) -> Iterator[tuple[Page, str]]:
    """Serve a page during the block; yields the page and its address.

    Args:
        contents: what to show.
        host: the address to listen on; 127.0.0.1: only programs of this machine can connect.
        port: the first to try; if it is taken, the next free one is used.

    Raises:
        DigsError: the server cannot listen there.
    """
    import viser

    _check_can_listen(host)
    with _silent():
        server = viser.ViserServer(host=host, port=port, label="digs-warp", verbose=False)
    page = None
    try:
        page = Page(server, contents)
        yield page, f"http://{host}:{server.get_port()}"
    finally:
        if page is not None:
            page.end()
        with _silent():
            server.stop()


def _check_can_listen(host: str) -> None:
    """Raise a `DigsError` for an address that is not this machine's; viser would wait forever."""
    try:
        socket.create_server((host, 0)).close()
    except OSError as error:
        raise DigsError(
            f"--host '{host}': cannot listen there ({error}); expected 127.0.0.1, 0.0.0.0 or an address of "
            "this machine"
        ) from error


def _silent() -> redirect_stdout[StringIO]:
    """Return a block in which viser prints nothing: a table of addresses, and that it stopped."""
    return redirect_stdout(StringIO())


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
