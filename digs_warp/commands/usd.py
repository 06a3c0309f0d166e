"""`digs-warp export-usd` and `digs-warp usd`: write, inspect and validate USD scenes."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from digs_warp.checks import DigsError, UsdError
from digs_warp.commands.command import Command, Group
from digs_warp.commands.output import JsonFile, check_output_file
from digs_warp.record.files import to_json
from digs_warp.usd.convert import WriteOptions
from digs_warp.words import counted, format_facts


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
            write_capture_package(capture, results, self.out, self.storage, self.surface)
        else:
            first = results[0]
            write_gaussians(self.out, first.gaussians, first.scene_metadata, self.storage)
        size = self.out.stat().st_size / 1e6
        return f"{self.out}: {counted(len(results[0].gaussians), 'Gaussian')}, {size:.1f} MB"


Scene = Annotated[Path, tyro.conf.Positional]


@dataclass(frozen=True, kw_only=True)
class UsdInfo(JsonFile, Command):
    """Say what a USD scene holds."""

    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """A .usdz, .usdc or .usda file."""

    prim: str | None = None
    """Path of the splats, such as /Asset/Gaussians; needed where a scene holds several fields of splats."""

    def execute(self) -> str:
        """Look and return the facts, one per line."""
        from digs_warp.show.report.facts import facts_of_usd
        from digs_warp.usd.reader import describe

        self.check(self.scene)
        scene = describe(self.scene, self.prim)
        self.write(to_json(scene))
        return format_facts(facts_of_usd(scene))


@dataclass(frozen=True, kw_only=True)
class UsdValidate(JsonFile, Command):
    """Check a USD scene; the exit code is 1 if there is an error.

    Checks values, sizes, color space, extents and the package, in every variant.
    Uses the rules of this program, those of OpenUSD, and NVIDIA's if usd-validation-nvidia is installed.
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
    "Inspect USD scenes of Gaussian splats, written by this or another program.",
    {"info": UsdInfo, "validate": UsdValidate},
)
