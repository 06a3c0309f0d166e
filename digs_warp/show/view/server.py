"""Starts and ends the server of a page."""

import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from io import StringIO

from digs_warp.checks import DigsError
from digs_warp.show.view.contents import Contents
from digs_warp.show.view.page import Page


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
