"""`digs-warp usd`: what a USD scene holds, whether it is sound, and how it differs from another."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from digs_warp.checks import DigsError, UsdError
from digs_warp.commands.facts import format_facts
from digs_warp.commands.output import check_output_file
from digs_warp.record.files import to_json, write_atomically


@dataclass(frozen=True, kw_only=True)
class Usd:
    """Look into USD scenes of Gaussian splats, of this program or another.

    digs-warp usd info scene.usdz; digs-warp usd validate scene.usdz; digs-warp usd diff a.usdz b.usdc
    """

    action: Annotated[
        Literal["info", "validate", "diff"],
        tyro.conf.Positional,
        tyro.conf.arg(
            metavar="ACTION",
            help="info: say what the scene holds. validate: check values, sizes, colour space, extents and "
            "package, in every variant and at every time sample, with the rules of this program, those of "
            "OpenUSD, and NVIDIA's where usd-validation-nvidia is installed; exits with 1 where an error is "
            "found. diff: say how two scenes differ, splat by splat; their axes and units do not count.",
        ),
    ]
    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A .usdz, .usdc or .usda file."""

    second: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="SECOND")] = None
    """For diff, the file to compare with."""

    prim: str | None = None
    """Path of the splats, such as /Asset/Gaussians, for info and diff where a scene holds several fields."""

    json: Path | None = None
    """Also write the result to this file, with all details."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace that file if it exists."""

    can_resume: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if (self.action == "diff") != (self.second is not None):
            raise DigsError(
                "usd diff takes two files"
                if self.action == "diff"
                else f"usd {self.action} takes one file"
            )

    def execute(self) -> str:
        """Run the action; a scene with errors is raised, so that the exit code tells."""
        if self.json is not None:
            check_output_file(self.json, self.overwrite)
        return {"info": self._info, "validate": self._validate, "diff": self._diff}[self.action]()

    def _info(self) -> str:
        from digs_warp.commands.summaries import facts_of_usd
        from digs_warp.usd.info import describe

        scene = describe(self.file, self.prim)
        self._write_json(to_json(scene))
        return format_facts(facts_of_usd(scene))

    def _validate(self) -> str:
        from digs_warp.usd.validate import validate

        report = validate(self.file)
        self._write_json(report.json())
        if not report.ok:
            raise UsdError(f"the scene is not sound\n{report.text()}")
        return report.text()

    def _diff(self) -> str:
        from digs_warp.usd.diff import differences

        assert self.second is not None
        found = differences(self.file, self.second, self.prim)
        self._write_json(to_json([asdict(each) for each in found]))
        return "\n".join(map(str, found)) or "the scenes hold the same"

    def _write_json(self, text: str) -> None:
        if self.json is not None:
            write_atomically(self.json, text.encode())
