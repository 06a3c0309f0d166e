"""`digs-warp study list|run|report`: which studies there are, run one, draw its report."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.commands.command import Command, Group, Preset
from digs_warp.engines.config import EngineConfig
from digs_warp.record.durations import DURATION
from digs_warp.settings import ITERATIONS, SECONDS, Range
from digs_warp.study.catalogue import STUDIES, Study, find_study
from digs_warp.words import format_facts

Name = Annotated[str, tyro.conf.Suppress]


@dataclass(frozen=True, kw_only=True)
class ListStudies(Command):
    """List the studies and the question of each."""

    def execute(self) -> str:
        """Return one line per study."""
        return format_facts({study.name: study.summary for study in STUDIES})


@dataclass(frozen=True, kw_only=True)
class RunStudy(Command):
    """Measure the cases that have no result yet, then draw the report of all results.

    Run it again after an interruption, or with more objects, seeds or time: finished cases are kept. Cases
    that run at the same time share the cores, so their seconds are only meaningful with one worker.
    """

    name: Name

    out: Path
    """Folder of the results and the report."""

    objects: Annotated[int, Range(1, 1000)]
    """How many objects; sample meshes come first, the built-in object last."""

    iterations: Annotated[int, ITERATIONS]
    """Training steps of each case. The paper's 12,000 would take days."""

    meshes: tuple[Path, ...] = ()
    """Mesh files to measure instead of the sample objects; the first --objects of them."""

    time_budget: Annotated[float | None, DURATION, SECONDS] = None
    """Start no case that would likely end later than this, for example 60s, 20min or 2h. The most important
    cases come first. Default: no limit."""

    seeds: Annotated[int, Range(1, 1000)] = 1
    """How often to repeat each case with another walk and other noise, to measure the spread."""

    on: Annotated[EngineConfig, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="engine")] = field(
        default_factory=EngineConfig
    )

    can_resume: ClassVar[bool] = True

    def execute(self) -> str:
        """Measure, and say how many cases there are and where the report is."""
        study = find_study(self.name)
        cases = study.cases(self.objects, self.seeds, self.iterations, self.meshes)
        return study.run(cases, self.out, self.on, self.time_budget)


@dataclass(frozen=True, kw_only=True)
class ReportStudy(Command):
    """Draw the report from existing results, without measuring."""

    name: Name

    out: Path
    """Folder of the results; the report goes there, too."""

    def execute(self) -> str:
        """Draw, and say where the report is."""
        return f"report: {find_study(self.name).report(self.out)}"


def _run_preset(study: Study) -> Preset:
    command = RunStudy(
        name=study.name, out=study.folder, objects=study.objects, iterations=study.iterations
    )
    return Preset(command, f"{study.title}: {study.summary}.\n\n{RunStudy.__doc__}")


def _report_preset(study: Study) -> Preset:
    command = ReportStudy(name=study.name, out=study.folder)
    return Preset(command, f"{study.title}: {study.summary}.\n\n{ReportStudy.__doc__}")


STUDY = Group(
    "Measure what settings cost and bring over many runs of the whole pipeline, and draw a report.",
    {
        "list": ListStudies,
        "run": Group("Run a study.", {study.name: _run_preset(study) for study in STUDIES}),
        "report": Group(
            "Draw the report of a study.", {study.name: _report_preset(study) for study in STUDIES}
        ),
    },
)
