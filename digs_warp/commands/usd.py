"""`digs-warp export-usd` and `digs-warp usd`: write and validate USD scenes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from digs_warp.checks import DigsError, UsdError
from digs_warp.commands.command import Command, Group
from digs_warp.commands.output import JsonFile, check_output_file
from digs_warp.usd.convert import Precision
from digs_warp.words import counted


@dataclass(frozen=True, kw_only=True)
class ExportUsd(Command):
    """Write reconstructed Gaussians as a USD scene, for USD viewers and simulators.

    With --capture the scene also holds the cameras, the recorded object and levels of detail.
    """

    source: Annotated[Path, tyro.conf.Positional]
    """A folder that 'digs-warp reconstruct' or 'digs-warp run' wrote, or its gaussians.npz."""

    out: Path
    """The file to write; its suffix decides: .usdz (package, one file), .usdc (binary), .usda (text)."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file if it exists."""

    capture: Path | None = None
    """The capture that was reconstructed: its cameras and sources go into the scene (.usdz only)."""

    surface: tyro.conf.FlagCreatePairsOff[bool] = False
    """With --capture, also put a colored mesh of the Gaussians into the scene, as 'digs-warp mesh' does."""

    precision: Precision = "float"
    """float keeps every digit; mixed halves all but the positions, and the file, at no visible loss."""

    def __post_init__(self) -> None:
        if self.surface and self.capture is None:
            raise DigsError("--surface needs --capture: its cameras see the surface")

    def execute(self) -> str:
        """Read, write, say what was written."""
        from digs_warp.data.capture import read_capture
        from digs_warp.pipeline.scene_files import read_scene
        from digs_warp.pipeline.usd_scene import write_capture_package
        from digs_warp.usd.writer import write_gaussians

        check_output_file(self.out, self.overwrite, [self.source, self.capture])
        capture = read_capture(self.capture) if self.capture else None
        result = read_scene(self.source, capture=capture)
        if capture is not None:
            write_capture_package(capture, result, self.out, self.precision, self.surface)
        else:
            metadata = result.scene_metadata
            write_gaussians(self.out, result.gaussians, metadata, self.precision)
        size = self.out.stat().st_size / 1e6
        return f"{self.out}: {counted(len(result.gaussians), 'Gaussian')}, {size:.1f} MB"


@dataclass(frozen=True, kw_only=True)
class UsdValidate(JsonFile, Command):
    """Check a USD scene; the exit code is 1 if there is an error.

    Checks values, sizes, color space, extents and the package, in every variant.
    Uses the rules of this program and those of OpenUSD.
    """

    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """A .usdz, .usdc or .usda file."""

    def execute(self) -> str:
        """Check; a scene with errors is raised, so that the exit code tells."""
        from digs_warp.usd.validate import validate

        self.check(self.scene)
        report = validate(self.scene)
        self.write(report.json())
        if not report.ok:
            raise UsdError(f"the scene is not sound\n{report.text()}")
        return report.text()


USD = Group(
    "Check USD scenes of Gaussian splats, written by this or another program.",
    {"validate": UsdValidate},
)
