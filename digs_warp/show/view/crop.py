"""A box on the page that cuts Gaussians, and the file that they are saved to."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.scene_files import check_target, write_scene_file


@dataclass(frozen=True)
class Box:
    """A box on the page, along its axes [page units]."""

    center: tuple[float, float, float]
    size: tuple[float, float, float]

    def holds(self, points_page: np.ndarray) -> np.ndarray:
        """Return which points, shape (n, 3), lie in it, shape (n,), bool."""
        away = np.abs(points_page - np.array(self.center, np.float32))
        return np.all(away <= 0.5 * np.array(self.size, np.float32), axis=1)


def save_cropped(target: Path, gaussians: Gaussians, keep: np.ndarray, source: str) -> str:
    """Write the Gaussians that are kept, in the world of their source; return what was done.

    Args:
        target: the file; its suffix decides the format.
        gaussians: in the world.
        keep: which of them, shape (n,), bool.
        source: where they come from, for a USD scene.

    Raises:
        DigsError: the suffix is unknown, the file exists, or nothing is kept.
    """
    check_target(target)
    if target.exists():
        raise DigsError(f"'{target}' exists; choose another name")
    if not keep.any():
        raise DigsError("no Gaussian lies in the box; move or enlarge it")
    result = Reconstruction(gaussians=gaussians.select(keep))
    write_scene_file(target, result, Path(source))
    return f"{target}: {np.count_nonzero(keep):,} of {len(keep):,} Gaussians"
