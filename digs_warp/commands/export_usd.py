"""`digs-warp export-usd`: Gaussians -> a USD scene."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.commands.layout import find_gaussians
from digs_warp.commands.output import check_output_file


@dataclass(frozen=True, kw_only=True)
class ExportUsd:
    """Write reconstructed Gaussians as a USD scene, for USD viewers and simulators."""

    source: Annotated[Path, tyro.conf.Positional]
    """A folder that 'digs-warp reconstruct' or 'digs-warp run' wrote, or its gaussians.npz."""

    out: Path
    """The file to write; its suffix decides: .usdz (package, one file), .usdc (binary), .usda (text)."""

    overwrite: bool = False
    """Replace the file if it exists."""

    can_resume: ClassVar[bool] = False

    def execute(self) -> str:
        """Read, write, say what was written."""
        from digs_warp.gaussians import Gaussians
        from usd.writer import write_gaussians

        check_output_file(self.out, self.overwrite)
        gaussians = Gaussians.load(find_gaussians(self.source))
        write_gaussians(self.out, gaussians)
        size = self.out.stat().st_size / 1e6
        return f"{self.out}: {len(gaussians):,} Gaussians, {size:.1f} MB"
