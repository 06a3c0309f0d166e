"""The browser that tests of pages drive: a visit ends when its own page is there."""

import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from headless_browser import NoBrowserError, browser

# How long the answers take [s]: the picture of /first is there before the page /second is.
SECONDS = {"/first": 0.0, "/first.svg": 0.5, "/second": 1.5, "/second.svg": 1.0}
PICTURE = b'<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'


class SlowPages(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        time.sleep(SECONDS.get(self.path, 0.0))
        is_picture = self.path.endswith(".svg")
        body = PICTURE if is_picture else f'<img src="{self.path}.svg">'.encode()
        self.send_response(200)
        self.send_header("Content-Type", "image/svg+xml" if is_picture else "text/html")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Not into the output of the tests."""


@pytest.fixture
def site() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), SlowPages) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_a_visit_does_not_end_with_the_page_before(site: str, tmp_path: Path) -> None:
    try:
        with browser(tmp_path / "profile") as tab:
            tab.visit("about:blank")
            tab.run(f"void (location.href = '{site}/first')")
            tab.wait_for("location.pathname === '/first'")
            tab.visit(f"{site}/second")
            assert tab.run("[location.pathname, document.readyState]") == ["/second", "complete"]
    except NoBrowserError as error:
        pytest.skip(str(error))
