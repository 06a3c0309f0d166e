"""`digs-warp study`: run a study, draw its report."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.checks import DigsError
from digs_warp.study.catalogue import STUDIES, Study

NAMES = tuple(study.name for study in STUDIES)


@dataclass(frozen=True, kw_only=True)
class StudyCommand:
    """Measure what settings cost and give, over many runs of the whole chain, and draw a report.

    What is measured already stays: call it again after an interruption, or with more objects, seeds or time.
    """

    name: Annotated[
        str,
        tyro.conf.Positional,
        tyro.conf.arg(
            metavar="NAME",
            help="What to study. " + "; ".join(f"{s.name}: {s.summary}" for s in STUDIES) + ".",
        ),
    ]

    out: Path | None = None
    """Folder of the results and the report. Default: out/study/NAME."""

    objects: int | None = None
    """How many objects; sample meshes come first, the built-in object last. Default: the study's own."""

    seeds: int = 1
    """How often each case is repeated with another walk and other noise: gives the spread."""

    iterations: int | None = None
    """Training steps of each case. Default: the study's own, which the paper's 12000 would take days."""

    minutes: float = math.inf
    """Begin no case that would probably end later; the cases that matter most come first."""

    workers: int = 1
    """Cases at the same time. They share the cores: faster, but only 1 gives times that mean something."""

    report_only: tyro.conf.FlagCreatePairsOff[bool] = False
    """Measure nothing; draw the report from what is there."""

    can_resume: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise DigsError(f"study '{self.name}': no such study; there is: {', '.join(NAMES)}")
        for name in ("objects", "seeds", "iterations", "workers"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise DigsError(f"study: --{name} {value}, expected at least 1")
        if not self.minutes > 0:
            raise DigsError(f"study: --minutes {self.minutes}, expected above 0")

    def execute(self) -> str:
        """Run the cases that are missing, then draw the report of all that are there."""
        from digs_warp.study.engine.chain import run_case
        from digs_warp.study.engine.runner import run_cases

        study = next(study for study in STUDIES if study.name == self.name)
        folder = self.out or Path("out") / "study" / study.name
        lines = []
        if not self.report_only:
            cases = study.cases(
                self.objects or study.objects, self.seeds, self.iterations or study.iterations
            )
            outcome = run_cases(
                cases,
                folder,
                measure=run_case,
                workers=self.workers,
                budget=60 * self.minutes,
            )
            lines.append(str(outcome))
        lines.append(f"report: {_write_report(study, folder)}")
        return "\n".join(lines)


def _write_report(study: Study, folder: Path) -> Path:
    from digs_warp.study.engine.page import write_pages
    from digs_warp.study.engine.store import RESULTS, Store

    records = list(Store(folder).records.values())
    good = [record for record in records if "error" not in record]
    if not good:
        errors = "; ".join(sorted({record["error"] for record in records})) or "there are none"
        raise DigsError(f"study '{folder / RESULTS}': no case ended well: {errors}")
    failed = len(records) - len(good)
    intro = f"{study.summary.capitalize()}. {len(good)} cases"
    intro += f", {failed} failed." if failed else "."
    return write_pages(study.title, intro, study.sections(good), folder)
