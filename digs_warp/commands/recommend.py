"""`digs-warp recommend`: the best measured settings within a time budget."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command
from digs_warp.commands.facts import format_facts
from digs_warp.commands.reconstruction_options import ReconstructionOptions
from digs_warp.record.durations import DURATION
from digs_warp.settings import SECONDS, Range

# Settings whose flag is not the last part of their name.
FLAGS = {"train.density.strategy": "density"}


@dataclass(frozen=True, kw_only=True)
class Recommend(Command):
    """Pick settings for a time budget from the results of 'digs-warp study run tradeoff'.

    Of a CAPTURE it looks at size, number of frames, depth, masks and view-dependence, and scales the measured
    seconds to it and to this machine; 'digs-warp reconstruct --recommended TIME' runs what it picks.
    """

    capture: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="[CAPTURE]")] = None
    """A recording. Without one the settings are for 'digs-warp run', as they were measured."""

    time_budget: Annotated[float, DURATION, SECONDS]
    """Time for the whole chain, for example 60s or 5min: from the recording to the Gaussians; with a CAPTURE,
    its reconstruction."""

    study: Path | None = None
    """Folder of the study. Default: out/study/tradeoff; without it, the published results, whose seconds
    are those of another machine."""

    machine_factor: Annotated[float | None, Range(1e-3, 1000)] = None
    """With a CAPTURE: how many times as long this machine takes as the one of the study. Default: as a second
    of training says."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.capture is None and self.machine_factor is not None:
            raise DigsError("--machine-factor is for a CAPTURE; name one")

    def execute(self) -> str:
        """Return the settings as flags, with their time and quality, and why."""
        if self.capture is not None:
            return self._for_capture(self.capture)
        from digs_warp.study.engine.store import Store
        from digs_warp.study.recommend.published import study_folder
        from digs_warp.study.studies.tradeoff import best_within, least_seconds

        folder = study_folder("tradeoff", self.study)
        records = Store(folder).finished()
        best = best_within(records, self.time_budget)
        if best is None:
            raise DigsError(
                f"recommend: no case in '{folder}' takes {self.time_budget:g} s or less, the fastest "
                f"{least_seconds(records):.1f} s; allow more time, or measure smaller recordings"
            )
        machines = sorted({record["machine"] for record in records})
        return format_facts(
            {
                "measured": f"on {' and '.join(machines)} ({folder})",
                "setting": best.name,
                "seconds": best.seconds.text(1),
                "PSNR": f"{best.quality.text(2)} dB on the object, views of a perfect camera",
                "command": shlex.join(
                    ["digs-warp", "run", "--out", "out/best", *flags(best.settings)]
                ),
                "left over": f"{self.time_budget - best.seconds.mean:.0f} s",
            }
        )

    def _for_capture(self, folder: Path) -> str:
        from digs_warp.data.capture import read_capture
        from digs_warp.study.recommend.choose import reasons, recommend
        from digs_warp.study.recommend.published import read_studies

        studies = read_studies(self.study)
        capture = read_capture(folder)
        config = ReconstructionOptions().reconstruct_config(0, capture)
        found = recommend(capture, self.time_budget, config, studies, self.machine_factor)
        poses = [] if capture.knows_poses else ["--poses", "sfm"]
        words = ["digs-warp", "reconstruct", str(folder), "--out", "out/best", *poses]
        return format_facts(
            {
                "measured": f"on {studies.machines} ({studies.folder})",
                **reasons(found),
                "command": shlex.join([*words, *flags(found.settings)]),
                "left over": f"{self.time_budget - found.best.seconds:.0f} s",
            }
        )


def flags(settings: dict[str, Any]) -> list[str]:
    """Return settings of recording and reconstruction as flags of `digs-warp run`, without scene and seed."""
    words: list[str] = []
    for name, value in settings.items():
        flag = FLAGS.get(name) or name.rpartition(".")[2].replace("_", "-")
        words += [f"--{flag}", f"{value:g}" if isinstance(value, float) else str(value)]
    return words
