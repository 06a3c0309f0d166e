"""A stereo pair with true disparity in both layouts that `digs-warp sensor fit` reads: a textured plane."""

import json
from pathlib import Path

import numpy as np

from digs_warp.data.images import write_image

WIDTH, HEIGHT, DISPARITY = 96, 64, 8  # [px]


def write_pair(folder: Path) -> None:
    """Write left.png, right.png, disp.npz and calib.json."""
    left, right = _images()
    write_image(folder / "left.png", left)
    write_image(folder / "right.png", right)
    np.savez(folder / "disp.npz", np.full((HEIGHT, WIDTH), DISPARITY, np.float32))
    calibration = {"fx_px": 80.0, "cx_px": 48.0, "cy_px": 32.0, "baseline_mm": 100.0}
    (folder / "calib.json").write_text(json.dumps(calibration))


def write_middlebury(folder: Path) -> None:
    """Write im0.png, im1.png, disp0.pfm and calib.txt."""
    left, right = _images()
    write_image(folder / "im0.png", left)
    write_image(folder / "im1.png", right)
    (folder / "calib.txt").write_text("cam0=[80 0 48; 0 80 32; 0 0 1]\nbaseline=100\n")
    header = f"Pf\n{WIDTH} {HEIGHT}\n-1\n".encode()
    disparity = np.full((HEIGHT, WIDTH), DISPARITY, "<f4")
    (folder / "disp0.pfm").write_bytes(header + disparity.tobytes())


def _images() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    wall = rng.integers(20, 236, (HEIGHT, WIDTH + DISPARITY, 3), np.uint8)
    return wall[:, :WIDTH], wall[:, DISPARITY:]
