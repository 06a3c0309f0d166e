"""Draw docs/images/view.jpg: the page of `digs-warp view`, as a browser shows it.

Usage: python scripts/view_picture.py [PATH...]   (default: out/demo, from `make demo`)

Needs Chromium: apt-get install chromium.
"""

import sys
import tempfile
import time
from pathlib import Path

import cv2
from headless_browser import browser

from digs_warp.record.files import write_atomically
from digs_warp.show.view.contents import read_contents
from digs_warp.show.view.server import started

TARGET = Path(__file__).resolve().parent.parent / "docs/images/view.jpg"

# How long a browser without a graphics card may take to load everything [s].
LOADING_SECONDS = 40
CLOSING_SECONDS = 3

# Closes the note that the browser draws in software.
CLOSE_NOTE = "document.querySelector('.mantine-Notification-closeButton')?.click()"


def main(paths: list[Path]) -> None:
    """Open the page, wait, and keep what the browser shows."""
    contents = [read_contents(path) for path in paths]
    with (
        started(contents, "127.0.0.1", 8080) as (page, address),
        tempfile.TemporaryDirectory() as folder,
        browser(Path(folder), (1280, 800)) as tab,
    ):
        page.controls.drawn.value = "color"
        tab.resize(1280, 720)
        tab.visit(address)
        time.sleep(LOADING_SECONDS)
        tab.run(CLOSE_NOTE)
        time.sleep(CLOSING_SECONDS)
        picture = tab.screenshot()
    done, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    assert done
    write_atomically(TARGET, data.tobytes())


if __name__ == "__main__":
    main([Path(argument) for argument in sys.argv[1:]] or [Path("out/demo")])
