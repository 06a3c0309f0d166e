"""A browser without a window, driven through its debugging port, for pictures and tests of pages."""

import base64
import itertools
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
INSTALL = "apt-get install chromium"

FLAGS = [
    *("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--remote-debugging-port=0", "--no-first-run"),
]


class NoBrowserError(Exception):
    """There is no browser, or it does not start; the message says what to install."""


class Browser:
    """One tab."""

    def __init__(self, address: str) -> None:
        from websockets.sync.client import connect

        self._socket = connect(address, max_size=None)
        self._numbers = itertools.count(1)
        self._events: set[str] = set()

    def visit(self, url: str) -> None:
        """Load a page, and wait until it is there."""
        self._call("Page.enable")
        self._call("Page.navigate", url=url)
        while "Page.loadEventFired" not in self._events:
            self._receive()

    def screenshot(self) -> np.ndarray:
        """Return the window's pixels, (height, width, 3), uint8."""
        import cv2

        data = base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert pixels is not None
        return pixels[..., ::-1]

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            answer = self._receive()
            if answer.get("id") == number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def _receive(self) -> dict[str, Any]:
        """Return the next message; remember it if it is an event."""
        message = json.loads(self._socket.recv(timeout=60))
        if "method" in message:
            self._events.add(message["method"])
        return message


@contextmanager
def browser(folder: Path, size: tuple[int, int] = (900, 700)) -> Iterator[Browser]:
    """Yield a browser with an empty profile in ``folder``; it ends with the block.

    Raises:
        NoBrowserError: there is none, or it does not start.
    """
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        raise NoBrowserError(f"no browser ({', '.join(PROGRAMS)}); install one with: {INSTALL}")
    process = subprocess.Popen(
        [
            program,
            *FLAGS,
            f"--window-size={size[0]},{size[1]}",
            f"--user-data-dir={folder}",
            "about:blank",
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield Browser(_first_tab(folder / "DevToolsActivePort", process))
    finally:
        process.kill()
        process.wait()


def _first_tab(port_file: Path, process: subprocess.Popen[bytes]) -> str:
    end = time.monotonic() + 60
    while time.monotonic() < end and process.poll() is None:
        if port_file.is_file() and port_file.read_text().strip():
            port = port_file.read_text().split()[0]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                tabs = [tab for tab in json.load(answer) if tab["type"] == "page"]
            if tabs:
                return tabs[0]["webSocketDebuggerUrl"]
        time.sleep(0.2)
    raise NoBrowserError("the browser does not start here")
