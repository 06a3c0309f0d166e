"""`digs-warp export-usd`: Gaussians -> a USD scene."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from digs_warp.commands.layout import EVALUATION, RUN_RECORD, find_gaussians
from digs_warp.commands.output import check_output_file
from digs_warp.commands.quality import read_quality
from digs_warp.log import read_json

if TYPE_CHECKING:
    from digs_warp.gaussians import Gaussians


@dataclass(frozen=True, kw_only=True)
class ExportUsd:
    """Write reconstructed Gaussians as a USD scene, for USD viewers and simulators."""

    source: Annotated[Path, tyro.conf.Positional]
    """A folder that 'digs-warp reconstruct' or 'digs-warp run' wrote, or its gaussians.npz."""

    out: Path
    """The file to write; its suffix decides: .usdz (package, one file), .usdc (binary), .usda (text)."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file if it exists."""

    can_resume: ClassVar[bool] = False

    def execute(self) -> str:
        """Read, write, say what was written."""
        from digs_warp.gaussians import Gaussians

        check_output_file(self.out, self.overwrite)
        source = find_gaussians(self.source)
        gaussians = Gaussians.load(source)
        write_scene(gaussians, source.parent, self.out)
        size = self.out.stat().st_size / 1e6
        return f"{self.out}: {len(gaussians):,} Gaussians, {size:.1f} MB"


def write_scene(gaussians: "Gaussians", reconstruction: Path, path: Path) -> None:
    """Write the scene; what is known about its making goes along as metadata."""
    from digs_warp.splat.config import DEFAULT_OPTIONS as options
    from usd.writer import write_gaussians

    # USD has no place for what the training assumed of its renderer.
    kernel = {
        "dilation_px2": options.dilation,
        "min_alpha": options.min_alpha,
        "max_alpha": options.max_alpha,
    }
    metadata: dict[str, Any] = {"kernel": kernel}
    if (reconstruction / RUN_RECORD).is_file():
        record = read_json(reconstruction / RUN_RECORD, "run record")
        metadata |= {key: record[key] for key in ("settings", "versions") if key in record}
    if (reconstruction / EVALUATION).is_file():
        metadata["held_out"] = read_quality(reconstruction).mean
    write_gaussians(path, gaussians, metadata)
