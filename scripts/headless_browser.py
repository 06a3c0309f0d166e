"""A browser without a window, driven through its debugging port, for pictures and tests of pages."""

import base64
import itertools
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator, Sequence
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

# What the browser answers when a page goes away while an expression waits for it.
PAGE_LEFT = "Inspected target navigated or closed"

_KEY_CODES = {
    **{"Tab": 9, "Enter": 13, "Home": 36, " ": 32},
    **{"ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Backspace": 8},
}


class NoBrowserError(Exception):
    """There is no browser, or it does not start; the message says what to install."""


class PageLeftError(RuntimeError):
    """The page went away while it was asked: the tab is on its way to another one."""


class Browser:
    """One tab.

    Attributes:
        requests: the addresses that pages asked for, since the first visit.
    """

    def __init__(self, address: str) -> None:
        from websockets.sync.client import connect

        # No pings: a browser that draws on a busy machine answers them too late.
        self._socket = connect(address, max_size=None, ping_interval=None)
        self._numbers = itertools.count(1)
        self._loaded: set[str] = set()  # loaders of the pages that are there
        self.requests: list[str] = []

    def visit(self, url: str) -> None:
        """Load a page, and wait until it is there."""
        self._call("Page.enable")
        self._call("Network.enable")
        self._call("Page.setLifecycleEventsEnabled", enabled=True)
        # By its loader: the page before may still be loading, and say so in between.
        loader = self._call("Page.navigate", url=url)["loaderId"]
        while loader not in self._loaded:
            self._receive()

    def run(self, script: str) -> Any:
        """Return the value of a JavaScript expression; promises are waited for.

        Raises:
            RuntimeError: it raised an error.
        """
        found = self._call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in found:
            raise RuntimeError(f"{script}: {found['exceptionDetails']}")
        return found["result"].get("value")

    def wait_for(self, condition: str, seconds: float = 180.0) -> None:
        """Wait until a JavaScript expression is true, on this page or on the one that follows it.

        Raises:
            TimeoutError: it is not.
        """
        end = time.monotonic() + seconds
        while not self._holds(condition):
            if time.monotonic() > end:
                raise TimeoutError(f"not within {seconds:g} s: {condition}")
            time.sleep(0.05)

    def press(self, key: str) -> None:
        """Press and release a key, by its name in events, such as "ArrowLeft" or "a"."""
        plain = len(key) == 1 and key.isascii() and key.isalnum()
        code = _KEY_CODES.get(key, ord(key.upper()) if plain else 0)
        about = {"key": key, "windowsVirtualKeyCode": code}
        text = {"text": key} if len(key) == 1 else {}
        self._call("Input.dispatchKeyEvent", type="keyDown", **about, **text)
        self._call("Input.dispatchKeyEvent", type="keyUp", **about)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press the left button at a place of the window [px], move, and release it; or click there."""
        button = {"button": "left", "clickCount": 1}
        for kind, (x, y) in (("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)):
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, buttons=1, **button)

    def touch(self, *moves: Sequence[tuple[float, float]]) -> None:
        """Put fingers on places of the window [px], move them to each further list of places, lift them."""
        for number, fingers in enumerate(moves):
            points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in enumerate(fingers)]
            kind = "touchMove" if number else "touchStart"
            self._call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        self._call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def click(self, selector: str) -> None:
        """Click the middle of an element, by its CSS selector, after scrolling to it."""
        element = f"document.querySelector({json.dumps(selector)})"
        self.run(f"{element}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
        box = self.run(f"JSON.parse(JSON.stringify({element}.getBoundingClientRect()))")
        place = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        self.drag(place, place)

    def resize(self, width: int, height: int, dark: bool = False) -> None:
        """Give the window another size [px], and light or dark colors."""
        size = {"width": width, "height": height}
        self._call("Emulation.setDeviceMetricsOverride", **size, deviceScaleFactor=1, mobile=False)
        theme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._call("Emulation.setEmulatedMedia", features=[theme])

    def screenshot(self) -> np.ndarray:
        """Return the window's pixels, (height, width, 3), uint8."""
        import cv2

        data = base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert pixels is not None
        return pixels[..., ::-1]

    def _holds(self, condition: str) -> bool:
        try:
            return bool(self.run(condition))
        except PageLeftError:
            return False

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            answer = self._receive()
            if answer.get("id") == number:
                if "error" in answer:
                    left = answer["error"]["message"] == PAGE_LEFT
                    raise (PageLeftError if left else RuntimeError)(f"{method}: {answer['error']}")
                return answer["result"]

    def _receive(self) -> dict[str, Any]:
        """Return the next message; keep what events say of requests and of pages that are there."""
        message = json.loads(self._socket.recv(timeout=300))
        if "method" in message:
            about = message["params"]
            if message["method"] == "Network.requestWillBeSent":
                self.requests.append(about["request"]["url"])
            elif message["method"] == "Page.lifecycleEvent" and about["name"] == "load":
                self._loaded.add(about["loaderId"])
        return message


@contextmanager
def browser(
    folder: Path, size: tuple[int, int] = (900, 700), flags: Sequence[str] = ()
) -> Iterator[Browser]:
    """Yield a browser with an empty profile in ``folder`` and further flags; it ends with the block.

    Raises:
        NoBrowserError: there is none, or it does not start.
    """
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        raise NoBrowserError(f"no browser ({', '.join(PROGRAMS)}); install one with: {INSTALL}")
    own = [f"--window-size={size[0]},{size[1]}", f"--user-data-dir={folder}", "about:blank"]
    process = subprocess.Popen(
        [program, *FLAGS, *flags, *own], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield Browser(_first_tab(folder / "DevToolsActivePort", process))
    finally:
        process.kill()
        process.wait()


def _first_tab(port_file: Path, process: subprocess.Popen[bytes]) -> str:
    end = time.monotonic() + 180
    while time.monotonic() < end and process.poll() is None:
        if port_file.is_file() and port_file.read_text().strip():
            port = port_file.read_text().split()[0]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                tabs = [tab for tab in json.load(answer) if tab["type"] == "page"]
            if tabs:
                return tabs[0]["webSocketDebuggerUrl"]
        time.sleep(0.2)
    raise NoBrowserError("the browser does not start here")
