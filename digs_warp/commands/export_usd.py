"""`digs-warp export-usd`: Gaussians -> a USD scene."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command
from digs_warp.commands.output import check_output_file
from digs_warp.usd.convert import WriteOptions
from digs_warp.words import counted


@dataclass(frozen=True, kw_only=True)
class ExportUsd(Command):
    """Write reconstructed Gaussians as a USD scene, for USD viewers and simulators.

    With --capture the scene also holds the cameras, the initial points, the recorded object and levels of
    detail; with --also it holds several reconstructions of that capture as variants.
    """

    source: Annotated[Path, tyro.conf.Positional]
    """A folder that 'digs-warp reconstruct' or 'digs-warp run' wrote, or its gaussians.npz."""

    out: Path
    """The file to write; its suffix decides: .usdz (package, one file), .usdc (binary), .usda (text)."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file if it exists."""

    capture: Path | None = None
    """The capture that was reconstructed: its cameras and sources go into the scene (.usdz only)."""

    also: tuple[Path, ...] = ()
    """More reconstructions of that capture: each becomes a variant, named after its initialization."""

    surface: tyro.conf.FlagCreatePairsOff[bool] = False
    """With --capture, also put a colored mesh of the Gaussians into the scene, as 'digs-warp mesh' does."""

    storage: Annotated[WriteOptions, tyro.conf.OmitArgPrefixes] = field(
        default_factory=WriteOptions
    )

    def __post_init__(self) -> None:
        if self.surface and self.capture is None:
            raise DigsError("--surface needs --capture: its cameras see the surface")
        if self.also and self.capture is None:
            raise DigsError("--also needs --capture: the variants show one recording")

    def execute(self) -> str:
        """Read, write, say what was written."""
        from digs_warp.data.capture import read_capture
        from digs_warp.pipeline.scene_files import read_scene
        from digs_warp.pipeline.usd_scene import write_capture_package
        from digs_warp.usd.writer import write_gaussians

        inputs = [self.source, self.capture, *self.also]
        check_output_file(self.out, self.overwrite, inputs)
        capture = read_capture(self.capture) if self.capture else None
        results = [read_scene(path, capture=capture) for path in (self.source, *self.also)]
        if capture is not None:
            scenes = [result.in_scene() for result in results]
            write_capture_package(capture, scenes, self.out, self.storage, self.surface)
        else:
            first = results[0]
            write_gaussians(self.out, first.gaussians, first.scene_metadata, self.storage)
        size = self.out.stat().st_size / 1e6
        return f"{self.out}: {counted(len(results[0].gaussians), 'Gaussian')}, {size:.1f} MB"
