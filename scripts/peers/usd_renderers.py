"""Draw the USD scenes of runs with Mitsuba and with our renderer, in the views held out; print a table.

    digs-warp run --out out/demo
    python -m venv /tmp/mitsuba && /tmp/mitsuba/bin/pip install mitsuba==3.8.0 usd-core
    python -m scripts.peers.usd_renderers /tmp/mitsuba/bin/python out/demo out/bottle

Mitsuba runs in its own environment and takes splats and cameras from the file (`mitsuba_draw.py`); ours takes
the splats from the file and the cameras from the capture, so that a wrong pose or lens in the file shows.
What differs then is the order in which a ray takes the splats. Both are compared with the photograph.
With --page the table also goes into docs/usd.md, between its two marks.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.ndimage import binary_erosion

from digs_warp.data.capture import read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.measure.metrics import psnr
from digs_warp.splat.render import render
from digs_warp.usd.reader import read_scene
from scripts.page_marks import fill
from studies.results import Result, format_tables, tables

BLACK = (0.0, 0.0, 0.0)
COLUMNS: tuple[str, ...] = (
    "ours and Mitsuba [dB]",
    "photograph: ours [dB]",
    "photograph: Mitsuba [dB]",
)


def compared(python: str, run: Path) -> Result:
    """Return the mean scores of a run's held-out views, on the object without its rim."""
    capture = read_capture(run / "capture")
    tests = {frame.name for frame in capture.split()[1]}
    numbers = [n for n, frame in enumerate(capture.frames) if frame.name in tests]
    gaussians = read_scene(run / "scene.usdz").gaussians
    k = capture.frames[0].camera.intrinsics
    with tempfile.TemporaryDirectory() as folder:
        command = [python, Path(__file__).with_name("mitsuba_draw.py"), run / "scene.usdz"]
        views = ["/Asset/Rig/left", *map(str, numbers), "--size", str(k.width), str(k.height)]
        subprocess.run([*command, *views, "--out", folder], check=True)
        scores = [
            _scores(capture.frames[n], gaussians, np.load(Path(folder) / f"{n}.npy"))
            for n in numbers
        ]
    values = dict(zip(COLUMNS, np.mean(scores, axis=0).tolist(), strict=True))
    return Result({"scene": run.name, "views": len(numbers)}, values)


def _scores(frame: Frame, gaussians: Gaussians, theirs: np.ndarray) -> list[float]:
    inside = binary_erosion(frame.load_mask() > 0)
    ours = np.clip(render(gaussians, frame.camera, background=BLACK).image, 0, 1)
    theirs, photograph = np.clip(theirs, 0, 1), frame.load_image() / 255
    pairs = (ours, theirs), (ours, photograph), (theirs, photograph)
    return [psnr(one, other, inside) for one, other in pairs]


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("python", help="of the environment that has Mitsuba")
    parser.add_argument("runs", type=Path, nargs="+", help="folders of digs-warp run")
    parser.add_argument("--page", action="store_true", help="also write the table into docs/usd.md")
    arguments = parser.parse_args()
    results = [compared(arguments.python, run) for run in arguments.runs]
    sys.stdout.write(format_tables(results) + "\n")
    if arguments.page:
        (table,) = tables(results)
        fill("usd.md", "renderers", table.markdown())


if __name__ == "__main__":
    main()
