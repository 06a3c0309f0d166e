"""`digs-warp recommend`: the best measured settings within a time budget."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from digs_warp.bounds import check_flag
from digs_warp.checks import DigsError
from digs_warp.commands.command import Command
from digs_warp.commands.facts import format_facts
from digs_warp.record.durations import DURATION

# Its results are those of docs/study: a link in the repository, a copy in an installed package.
PUBLISHED = Path(__file__).parents[1] / "study" / "published" / "tradeoff"

# Settings whose flag is not the last part of their name.
FLAGS = {"train.density.strategy": "density"}


@dataclass(frozen=True, kw_only=True)
class Recommend(Command):
    """Pick settings for a time budget from the results of 'digs-warp study run tradeoff'."""

    time_budget: Annotated[float, DURATION]
    """Time for the whole chain, from the recording to the Gaussians, for example 60s or 5min."""

    study: Path | None = None
    """Folder of the study. Default: out/study/tradeoff; without it, the published results, whose seconds
    are those of another machine."""

    def __post_init__(self) -> None:
        check_flag("--time-budget", self.time_budget)

    def execute(self) -> str:
        """Return the settings as flags, with their measured time and quality."""
        from digs_warp.engines.results import RESULTS
        from digs_warp.study.engine.store import Store
        from digs_warp.study.studies.tradeoff import best_within

        own = Path("out/study/tradeoff")
        folder = self.study or (own if (own / RESULTS).is_file() else PUBLISHED)
        if not (folder / RESULTS).is_file():
            raise DigsError(
                f"recommend: no study in '{folder}'; measure one first: digs-warp study run tradeoff --out "
                f"{folder}"
            )
        records = Store(folder).finished()
        best = best_within(records, self.time_budget)
        if best is None:
            raise DigsError(
                f"recommend: no case in '{folder}' takes {self.time_budget:g} s or less; allow more time, or "
                "measure smaller recordings"
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


def flags(settings: dict[str, Any]) -> list[str]:
    """Return settings of recording and reconstruction as flags of `digs-warp run`, without scene and seed."""
    words: list[str] = []
    for name, value in settings.items():
        flag = FLAGS.get(name) or name.rpartition(".")[2].replace("_", "-")
        words += [f"--{flag}", f"{value:g}" if isinstance(value, float) else str(value)]
    return words
