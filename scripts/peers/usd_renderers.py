"""Draw the USD scenes of runs with Mitsuba and with our renderer, in the views held out; print a table.

    digs-warp run --out out/demo
    python -m venv /tmp/mitsuba && /tmp/mitsuba/bin/pip install mitsuba==3.8.0 usd-core
    python -m scripts.peers.usd_renderers /tmp/mitsuba/bin/python out/demo out/bottle

Mitsuba runs in its own environment and takes splats and cameras from the file (`mitsuba_draw.py`); ours takes
the splats from the file and the cameras from the capture, so that a wrong pose or lens in the file shows.
What differs then is the order in which a ray takes the splats. So a sample of pixels is also composited
with NumPy, ray by ray, in the orders that renderers use. All are compared with the photograph.
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
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.geometry.sh import rgb_from_sh
from digs_warp.measure.metrics import psnr
from digs_warp.splat.render import render
from digs_warp.usd.reader import read_scene
from scripts.page_marks import fill
from studies.results import Result, format_tables, tables

BLACK = (0.0, 0.0, 0.0)
# Pixels of a view that are composited ray by ray.
SAMPLE = 300
# Deviations at which Mitsuba's rays enter a splat.
SHELL = 3.0
COLUMNS: tuple[str, ...] = (
    "ours and Mitsuba [dB]",
    "photograph: ours [dB]",
    "by depth [dB]",
    "by the peak on the ray [dB]",
    "by entry at 3 deviations [dB]",
    "Mitsuba [dB]",
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
    rows, columns = np.nonzero(inside)
    some = np.random.default_rng(0).permutation(len(rows))[:SAMPLE]
    rows, columns = rows[some], columns[some]
    ours = render(gaussians, frame.camera, background=BLACK).image
    photograph = frame.load_image() / 255
    orders = ray_orders(gaussians, frame.camera, rows, columns)
    drawn = [ours[rows, columns], *orders.swapaxes(0, 1), theirs[rows, columns]]
    target = photograph[rows, columns]
    both = psnr(np.clip(ours, 0, 1), np.clip(theirs, 0, 1), inside)
    return [both, *(psnr(np.clip(colors, 0, 1)[None], target[None]) for colors in drawn)]


def ray_orders(
    gaussians: Gaussians, camera: Camera, rows: np.ndarray, columns: np.ndarray
) -> np.ndarray:
    """Return the colors of n pixels with the splats of each ray in three orders, (n, 3, 3), float64.

    By the depth of their centers, by where they are densest on the ray, by where the ray enters their shell.
    """
    k, center = camera.intrinsics, camera.center_world
    u, v = (columns + 0.5 - k.cx) / k.fx, (rows + 0.5 - k.cy) / k.fy
    rays = np.stack([u, v, np.ones(len(u))], axis=1) @ camera.world_from_cam[:3, :3].T
    away = gaussians.means.astype(np.float64) - center
    depth = away @ camera.world_from_cam[:3, 2]
    colors = rgb_from_sh(gaussians.sh, away / np.linalg.norm(away, axis=1, keepdims=True))
    axes = matrix_from_quat_xyzw(gaussians.quats.astype(np.float64)).swapaxes(1, 2)
    whiten = axes / np.exp(gaussians.log_scales.astype(np.float64))[:, :, None]
    start = np.einsum("nij,nj->ni", whiten, -away)
    found = np.empty((len(rays), 3, 3))
    for ray, result in zip(rays / np.linalg.norm(rays, axis=1, keepdims=True), found, strict=True):
        step = whiten @ ray
        speed = (step**2).sum(axis=1)
        peak = -(start * step).sum(axis=1) / speed
        squared = (start**2).sum(axis=1) - peak**2 * speed
        alpha = gaussians.opacities * np.exp(-0.5 * squared)
        seen = (alpha > 1 / 255) & (peak > 0)
        entry = peak - np.sqrt(np.maximum(0.0, SHELL**2 - squared) / speed)
        for number, place in enumerate((depth, peak, entry)):
            order = np.argsort(place[seen])
            a = np.minimum(alpha[seen][order], 0.9999)
            left = np.concatenate([[1.0], np.cumprod(1 - a)[:-1]])
            result[number] = (left * a) @ colors[seen][order]
    return found


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
