"""Gaussians in the course of a training, one file for each iteration that was kept.

Only colours that do not depend on the direction are kept: 56 bytes a splat, a quarter of all at degree 3.
"""

from dataclasses import replace
from pathlib import Path

from digs_warp.data.gaussians import Gaussians
from digs_warp.record.layout import COURSE


def save_snapshot(folder: Path, iteration: int, gaussians: Gaussians) -> None:
    """Keep the Gaussians of an iteration in the folder of a reconstruction."""
    plain = replace(gaussians, sh=gaussians.sh[:, :1])
    plain.save(folder / COURSE / f"{iteration:08d}.npz")


def load_snapshots(folder: Path) -> tuple[tuple[int, Gaussians], ...]:
    """Return (iteration, Gaussians), ascending; empty where none were kept.

    Raises:
        DigsError: a file is truncated or lacks a field.
    """
    return tuple((int(path.stem), Gaussians.load(path)) for path in _files(folder))


def drop_snapshots_after(folder: Path, iteration: int) -> None:
    """Forget what a run, that now goes on from an earlier iteration or anew, did after it."""
    for path in _files(folder):
        if int(path.stem) > iteration or iteration == 0:
            path.unlink()


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / COURSE).glob("*.npz") if path.stem.isdecimal())
