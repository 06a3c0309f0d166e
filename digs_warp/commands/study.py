"""`digs-warp study list|run|report`: which studies there are, run one, draw its report."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.facts import format_facts
from digs_warp.record.durations import DURATION
from digs_warp.study.catalogue import STUDIES, Study

Name = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="NAME", help=f"One of: {', '.join(s.name for s in STUDIES)}."),
]


@dataclass(frozen=True, kw_only=True)
class ListStudies:
    """Say which studies there are and what each asks."""

    def execute(self) -> str:
        """Return one line per study."""
        return format_facts({study.name: study.summary for study in STUDIES})


@dataclass(frozen=True, kw_only=True)
class RunStudy:
    """Measure the cases that are missing, then draw the report of all that are there.

    Cases that are measured already stay: call it again after an interruption, or with more objects, seeds
    or time.
    """

    name: Name

    time_budget: Annotated[float | None, DURATION] = None
    """Start no case that would likely end later than this, for example 60s, 20min or 2h. The most important
    cases come first. Default: no limit."""

    out: Path | None = None
    """Folder of the results and the report. Default: out/study/NAME."""

    objects: int | None = None
    """How many objects; sample meshes come first, the built-in object last. Default: the study's own."""

    seeds: int = 1
    """How often each case is repeated with another walk and other noise: gives the spread."""

    iterations: int | None = None
    """Training steps of each case. Default: the study's own, which the paper's 12000 would take days."""

    workers: int = 1
    """Cases at the same time. They share the cores: faster, but only 1 gives times that mean something."""

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
        return f"{outcome}\nreport: {write_report(study, folder)}"


@dataclass(frozen=True, kw_only=True)
class ReportStudy:
    """Measure nothing; draw the report from the results that are there."""

    name: Name

    out: Path | None = None
    """Folder of the results; the report is written there. Default: out/study/NAME."""

    def __post_init__(self) -> None:
        find_study(self.name)

    def execute(self) -> str:
        """Draw, and say where the report is."""
        study = find_study(self.name)
        return f"report: {write_report(study, self.out or study.folder)}"


@dataclass(frozen=True, kw_only=True)
class StudyCommand:
    """Measure what settings cost and give, over many runs of the whole chain, and draw a report."""

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


def find_study(name: str) -> Study:
    """Return the study of that name.

    Raises:
        DigsError: there is none.
    """
    for study in STUDIES:
        if study.name == name:
            return study
    known = ", ".join(study.name for study in STUDIES)
    raise DigsError(f"study '{name}': no such study; there is: {known}")


def write_report(study: Study, folder: Path) -> Path:
    """Draw the report of the results in ``folder`` and return its HTML page.

    Raises:
        DigsError: no case ended well; the message has their errors.
    """
    from digs_warp.study.engine.store import RESULTS, Store
    from digs_warp.study.page import write_pages

    records = list(Store(folder).records.values())
    good = [record for record in records if "error" not in record]
    if not good:
        errors = "; ".join(sorted({record["error"] for record in records})) or "there are none"
        raise DigsError(
            f"study '{folder / RESULTS}': no case ended well: {errors}; measure some with 'digs-warp study "
            f"run {study.name}'"
        )
    failed = len(records) - len(good)
    intro = f"{study.summary[0].upper()}{study.summary[1:]}. {len(good)} cases"
    intro += f", {failed} failed." if failed else "."
    machines = sorted({record["machine"] for record in good})
    intro += f" Measured on {' and '.join(machines)}."
    return write_pages(study.title, intro, study.sections(good), folder)
