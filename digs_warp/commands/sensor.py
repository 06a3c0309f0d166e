"""`digs-warp sensor fit`: the figures of a depth camera from its recordings."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command, Group
from digs_warp.commands.output import check_output_file
from digs_warp.record.files import write_atomically
from digs_warp.settings import Range
from digs_warp.words import did_you_mean

if TYPE_CHECKING:
    from digs_warp.sim.camera.profiles import Profile
    from digs_warp.sim.fit.result import Fit

SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True, kw_only=True)
class FitSensor(Command):
    """Fit the figures of a depth camera to a recording, and write them as a profile for --profile.

    The recording is a capture of a flat, textured wall that fills the image: several frames of a camera at
    rest at each of 4 to 6 distances, tilted by 10 to 20 degrees ('digs-warp convert --from' makes captures of
    real recordings). An infrared pair beside the color camera is fitted from its own images.

    Beside the profile it writes a page of the same name (.html) with standard errors, and with the statistics
    of the recording beside those of the same scene recorded by the simulated camera.
    """

    recording: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RECORDING")]
    """A capture folder."""

    out: Path
    """The profile to write, a .yaml file."""

    base: str = "zed2-720"
    """The built-in profile that has the figures that the recording cannot tell."""

    distances: Annotated[tuple[float, ...] | None, Range(0.01, 1000)] = None
    """Depth of the wall in the middle of the image [m], one for each place of the camera, from near to far:
    they show the bias."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the files if they exist."""

    def execute(self) -> str:
        """Fit, write profile and page, and return the figures."""
        from digs_warp.sim.camera.profiles import PROFILES, load_profile
        from digs_warp.sim.fit.result import write_profile
        from digs_warp.study.fit_page import figures_table, fit_page

        if self.base not in PROFILES:
            raise DigsError(f"--base '{self.base}': unknown{did_you_mean(self.base, PROFILES)}")
        if self.out.suffix.lower() not in SUFFIXES:
            raise DigsError(
                f"--out '{self.out}': suffix '{self.out.suffix}', expected {' or '.join(SUFFIXES)}"
            )
        page = self.out.with_suffix(".html")
        for path in (self.out, page):
            check_output_file(path, self.overwrite, [self.recording])
        base = load_profile(self.base)
        fit = self._fit(base)
        title = f"{self.recording.resolve().name}, fitted"
        write_profile(self.out, fit, self.base, title)
        write_atomically(page, fit_page(fit, base, title).encode())
        lines = [
            fit.about,
            figures_table(fit, base).text(),
            *(f"beware: {doubt}" for doubt in fit.doubts),
            f"{self.out}: use it with --profile {self.out}; measured beside simulated: {page}",
        ]
        return "\n\n".join(lines)

    def _fit(self, base: "Profile") -> "Fit":
        from digs_warp.data.capture import read_capture
        from digs_warp.sim.fit.fit_wall import fit_wall
        from digs_warp.sim.fit.wall import read_wall

        wall = read_wall(read_capture(self.recording), base.figures["baseline"].value)
        rig = replace(base.rig(), intrinsics=wall.intrinsics, baseline=wall.baseline)
        return fit_wall(wall, rig, self.distances)


SENSOR = Group(
    "Measure depth cameras, so that they can be simulated.",
    {"fit": FitSensor},
)
