"""Serves the page of `digs-warp view` to the browsers of this machine."""

import errno
import json
import os
import sys
import threading
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import unquote

from digs_warp.checks import DigsError
from digs_warp.data.images import encode_jpeg
from digs_warp.show.report.view3d.pack import pack
from digs_warp.show.view.contents import Contents
from digs_warp.show.view.layers import load_picture
from digs_warp.show.view.page import page_of

# Gaussians of a layer take at most so many bytes.
MOST_BYTES = 200_000_000
# Ports that are tried after the first.
PORTS = 100


class View:
    """What the page shows, for the threads that answer browsers."""

    def __init__(self, contents: Sequence[Contents]) -> None:
        self._contents = contents
        self._layers = [each.layers() for each in contents]

    def answer(self, path: str) -> tuple[str, bytes, dict[str, str]] | None:
        """Return kind, content and headers of what is at a path; None: nothing."""
        match [unquote(part) for part in path.strip("/").split("/")]:
            case [""]:
                layers = [{name: len(sets) for name, sets in each.items()} for each in self._layers]
                page = page_of(self._contents, layers)
                return "text/html; charset=utf-8", page.encode(), {}
            case ["splats", number, layer, stage]:
                packed = pack(self._layers[int(number)][layer][int(stage)], MOST_BYTES)
                about = {"X-About": json.dumps(packed.about())}
                return "application/octet-stream", packed.to_bytes(), about
            case ["picture", number, frame_name, kind]:
                frames = self._contents[int(number)].frames
                frame = next(frame for frame in frames if frame.name == frame_name)
                picture = load_picture(frame, kind)
                return None if picture is None else ("image/jpeg", encode_jpeg(picture), {})
        return None


class _Handler(BaseHTTPRequestHandler):
    view: View

    def handle(self) -> None:
        """Answer, unless the browser has gone meanwhile."""
        with suppress(ConnectionError):
            super().handle()

    def do_GET(self) -> None:
        try:
            found = self.view.answer(self.path)
        except (LookupError, ValueError, StopIteration, DigsError):
            found = None
        if found is None:
            self.send_error(404)
            return
        self._send(*found)

    def _send(self, kind: str, content: bytes, headers: dict[str, str]) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing of each request."""


@contextmanager
def started(contents: Sequence[Contents], host: str, port: int) -> Iterator[str]:
    """Serve a page during the block; yields its address.

    Args:
        contents: what to show.
        host: the address to listen on; 127.0.0.1: only programs of this machine can connect.
        port: the first to try; if it is taken, the next free one is used.

    Raises:
        DigsError: the server cannot listen there.
    """
    server = _listening(host, port, type("Handler", (_Handler,), {"view": View(contents)}))
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, name="view", daemon=True)
    thread.start()
    try:
        yield f"http://{host}:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def open_in_browser(address: str) -> None:
    """Open a page, where there is a screen: without one, Python would start a browser of the terminal."""
    screens = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if screens or not sys.platform.startswith("linux"):
        webbrowser.open(address)


def _listening(host: str, first: int, handler: type[_Handler]) -> ThreadingHTTPServer:
    for port in range(first, min(first + PORTS, 65_536)):
        try:
            return ThreadingHTTPServer((host, port), handler)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise DigsError(
                    f"--host '{host}': cannot listen there ({error}); expected 127.0.0.1, 0.0.0.0 or an "
                    "address of this machine"
                ) from error
    raise DigsError(f"--port {first}: it and the {PORTS} after it are taken; name another one")
