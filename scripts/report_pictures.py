"""Draw docs/images/report.jpg and report-phone.jpg: the report of a run, as a browser shows it.

Usage: python scripts/report_pictures.py [RUN_FOLDER]   (default: out/demo, from `make demo`)

Needs Chromium: apt-get install chromium.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from headless_browser import Browser, browser

from digs_warp.data.images import encode_jpeg
from digs_warp.record.files import write_atomically

IMAGES = Path(__file__).resolve().parent.parent / "docs/images"

# A browser without a graphics card takes this long at most for the first picture [s].
LONGEST = 120

DESK, PHONE = (1280, 1010), (390, 780)
CANVAS = "document.querySelector('#view3d canvas')"


def main(run: Path) -> None:
    """Open the report at both sizes, the second one with its cameras, and keep what the browser shows."""
    with tempfile.TemporaryDirectory() as folder, browser(Path(folder), DESK) as tab:
        tab.resize(*DESK)
        tab.visit((run / "report.html").resolve().as_uri())
        keep(shown(tab), "report.jpg")
        tab.resize(*PHONE)
        tab.click("#view3d input")
        keep(shown(tab), "report-phone.jpg")


def shown(tab: Browser) -> np.ndarray:
    """Return the window with the top of the 3D section, once it is drawn in full detail."""
    top = "document.querySelector('section:has(#view3d)').scrollIntoView({behavior: 'instant'})"
    tab.run("document.fonts.ready.then(() => true)")
    tab.run(top)
    tab.run("new Promise((done) => setTimeout(done, 1000))")
    tab.wait_for(f"{CANVAS}.dataset.detail === '1'", LONGEST)
    return tab.screenshot()


def keep(picture: np.ndarray, name: str) -> None:
    """Write a picture of the documentation."""
    write_atomically(IMAGES / name, encode_jpeg(np.ascontiguousarray(picture), 85))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/demo"))
