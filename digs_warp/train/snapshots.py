"""Snapshots of the Gaussians during training, one file per snapshot.

Only the base color is kept, without view dependence: 56 bytes per splat, a quarter of the size at degree 3.
"""

from dataclasses import replace
from pathlib import Path

from digs_warp.data.gaussians import Gaussians
from digs_warp.record.files import remove
from digs_warp.record.layout import COURSE


def save_snapshot(folder: Path, iteration: int, gaussians: Gaussians) -> None:
    """Save the Gaussians of an iteration in the folder of a reconstruction."""
    plain = replace(gaussians, sh=gaussians.sh[:, :1])
    plain.save(folder / COURSE / f"{iteration:08d}.npz")


def load_snapshots(folder: Path) -> tuple[tuple[int, Gaussians], ...]:
    """Return (iteration, Gaussians) in ascending order; empty if none were saved.

    Raises:
        DigsError: a file is truncated or lacks a field.
    """
    return tuple((int(path.stem), Gaussians.load(path)) for path in _files(folder))


def drop_snapshots_after(folder: Path, iteration: int) -> None:
    """Delete the snapshots after ``iteration``, from which a run now continues (0: from the start)."""
    for path in _files(folder):
        if int(path.stem) > iteration or iteration == 0:
            remove(path)


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / COURSE).glob("*.npz") if path.stem.isdecimal())
