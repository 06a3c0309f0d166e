"""Flags for Gaussians from files of other programs: what `convert`, `render` and `mesh` share."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

if TYPE_CHECKING:
    from digs_warp.data.capture import Capture
    from digs_warp.pipeline.reconstruction import Reconstruction


@dataclass(frozen=True, kw_only=True)
class SplatOptions:
    """What splat files do not say themselves."""

    up: Literal["z", "y", "-y"] = "z"
    """The axis that points up in PLY and .splat files, which do not say it. z: as this program writes
    them; -y: most scenes that other programs trained; y: Y-up programs. SPZ and USD need no telling."""

    drop_broken: tyro.conf.FlagCreatePairsOff[bool] = False
    """Leave out Gaussians with NaN or infinite values instead of refusing a PLY, SPZ or .splat file."""

    def read(self, source: Path, capture: "Capture | None" = None) -> "Reconstruction":
        """Read the Gaussians of a file or folder; see `digs_warp.pipeline.scene_files.read_scene`."""
        from digs_warp.pipeline.scene_files import read_scene

        return read_scene(source, self.up, self.drop_broken, capture)
