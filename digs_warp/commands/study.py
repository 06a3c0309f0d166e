"""`digs-warp study list|run|report`: which studies there are, run one, draw its report."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.commands.command import Command, Group
from digs_warp.engines.config import EngineConfig
from digs_warp.record.durations import DURATION
from digs_warp.settings import ITERATIONS, SECONDS, Range
from digs_warp.study.catalogue import STUDIES, find_study
from digs_warp.words import format_facts

Name = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="STUDY")]


@dataclass(frozen=True, kw_only=True)
class ListStudies(Command):
    """List the studies and the question of each."""

    def execute(self) -> str:
        """Return one line per study."""
        return format_facts({study.name: study.summary for study in STUDIES})


@dataclass(frozen=True, kw_only=True)
class _OfStudy(Command):
    """A command on one study."""

    name: Name
    """Which one; 'digs-warp study list' lists them."""

    out: Path | None = None
    """Folder of the results and the report. Default: that of the study, in out/."""

    def __post_init__(self) -> None:
        super().__post_init__()
        find_study(self.name)


@dataclass(frozen=True, kw_only=True)
class RunStudy(_OfStudy):
    """Measure the cases that have no result yet, then draw the report of all results.

    Run it again after an interruption, or with more objects, seeds or time: finished cases are kept. Cases
    that run at the same time share the cores, so their seconds are only meaningful with one worker.
    """

    objects: Annotated[int | None, Range(1, 1000)] = None
    """How many objects; sample meshes come first, the built-in object last. Default: as the study has it."""

    iterations: Annotated[int | None, ITERATIONS] = None
    """Training steps of each case. The paper's 12,000 would take days. Default: as the study has it."""

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
        objects, steps = self.objects or study.objects, self.iterations
        steps = study.iterations if steps is None else steps
        cases = study.cases(objects, self.seeds, steps, self.meshes)
        return study.run(cases, self.out or study.folder, self.on, self.time_budget)


@dataclass(frozen=True, kw_only=True)
class ReportStudy(_OfStudy):
    """Draw the report from existing results, without measuring."""

    def execute(self) -> str:
        """Draw, and say where the report is."""
        study = find_study(self.name)
        return f"report: {study.report(self.out or study.folder)}"


STUDY = Group(
    "Measure what settings cost and bring over many runs of the whole pipeline, and draw a report.",
    {"list": ListStudies, "run": RunStudy, "report": ReportStudy},
)
