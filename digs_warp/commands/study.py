"""`digs-warp study list|run|report`: list the studies, run one, draw its report."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.facts import format_facts
from digs_warp.record.durations import DURATION
from digs_warp.study.catalogue import STUDIES, find_study

Name = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="NAME", help=f"One of: {', '.join(s.name for s in STUDIES)}."),
]


@dataclass(frozen=True, kw_only=True)
class ListStudies:
    """List the studies and the question of each."""

    def execute(self) -> str:
        """Return one line per study."""
        return format_facts({study.name: study.summary for study in STUDIES})


@dataclass(frozen=True, kw_only=True)
class RunStudy:
    """Measure the cases that have no result yet, then draw the report of all results.

    Run it again after an interruption, or with more objects, seeds or time: finished cases are kept.
    """

    name: Name

    time_budget: Annotated[float | None, DURATION] = None
    """Start no case that would likely end later than this, for example 60s, 20min or 2h. The most important
    cases come first. Default: no limit."""

    out: Path | None = None
    """Folder of the results and the report. Default: out/study/NAME."""

    objects: int | None = None
    """How many objects; sample meshes come first, the built-in object last. Default: depends on the study."""

    seeds: int = 1
    """How often to repeat each case with another walk and other noise, to measure the spread."""

    iterations: int | None = None
    """Training steps of each case. Default: as many as the study uses; the paper's 12000 would take days."""

    workers: int = 1
    """Cases to run at the same time. They share the cores, so times are only meaningful with 1."""

    def __post_init__(self) -> None:
        find_study(self.name)
        for name in ("objects", "seeds", "iterations", "workers"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise DigsError(f"study: --{name} {value}, expected at least 1")

    def execute(self) -> str:
        """Measure, and say how many cases there are and where the report is."""
        from digs_warp.study.engine.chain import run_case
        from digs_warp.study.engine.runner import run_cases

        study = find_study(self.name)
        folder = self.out or study.folder
        cases = study.cases(
            self.objects or study.objects, self.seeds, self.iterations or study.iterations
        )
        outcome = run_cases(
            cases,
            folder,
            measure=run_case,
            workers=self.workers,
            budget=self.time_budget,
        )
        return f"{outcome}\nreport: {study.report(folder)}"


@dataclass(frozen=True, kw_only=True)
class ReportStudy:
    """Draw the report from existing results, without measuring."""

    name: Name

    out: Path | None = None
    """Folder of the results; the report is written there. Default: out/study/NAME."""

    def __post_init__(self) -> None:
        find_study(self.name)

    def execute(self) -> str:
        """Draw, and say where the report is."""
        study = find_study(self.name)
        return f"report: {study.report(self.out or study.folder)}"


@dataclass(frozen=True, kw_only=True)
class StudyCommand:
    """Measure costs and gains of settings over many runs of the whole chain, and draw a report."""

    action: Annotated[
        Annotated[ListStudies, tyro.conf.subcommand("list")]
        | Annotated[RunStudy, tyro.conf.subcommand("run")]
        | Annotated[ReportStudy, tyro.conf.subcommand("report")],
        tyro.conf.arg(name=""),
    ]

    can_resume: ClassVar[bool] = True

    def execute(self) -> str:
        """Do what was asked for."""
        return self.action.execute()
