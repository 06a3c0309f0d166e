"""The studies of ``digs-warp study``; imports none of them, because the command line reads this."""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.checks import DigsError
from digs_warp.engines.config import EngineConfig
from digs_warp.words import counted, did_you_mean

if TYPE_CHECKING:
    from digs_warp.study.engine.case import Case


@dataclass(frozen=True)
class Study:
    """A question, and the module that answers it.

    The module has ``cases(objects, seeds, iterations)``, the most important first, and
    ``sections(records)``, the content of the report.

    Attributes:
        name: as the command line takes it; also that of the module.
        title: of the report.
        summary: one line for help and report.
        objects, iterations: defaults of the command line.
    """

    name: str
    title: str
    summary: str
    objects: int
    iterations: int

    @property
    def folder(self) -> Path:
        """The default folder of results and report."""
        return Path("out") / "study" / self.name

    @property
    def module(self) -> Any:
        """What answers the question."""
        return importlib.import_module(f"digs_warp.study.studies.{self.name}")

    def cases(
        self, objects: int, seeds: int, iterations: int, meshes: Sequence[Path] = ()
    ) -> "Sequence[Case]":
        """Return the cases for that many objects: sample objects, or ``meshes``, files of one's own."""
        from digs_warp.study.scenes import objects as named

        return self.module.cases(named(objects, meshes), seeds, iterations)

    def run(
        self,
        cases: "Sequence[Case]",
        folder: Path,
        engine: EngineConfig | None = None,
        budget: float | None = None,
    ) -> str:
        """Measure the cases that have no result in ``folder`` yet, draw the report, and say where it is.

        Raises:
            DigsError: the folder holds something else: the report would replace files of the same names.
        """
        from digs_warp.engines.task import RESULTS
        from digs_warp.study.engine.chain import CAPTURES, run_case
        from digs_warp.study.engine.runner import run_cases

        there = {path.name for path in folder.iterdir()} if folder.is_dir() else set[str]()
        if there and not there & {RESULTS, CAPTURES}:
            raise DigsError(
                f"--out '{folder}': the folder is not empty and holds no study; name another folder"
            )
        outcome = run_cases(cases, folder, measure=run_case, engine=engine, budget=budget)
        return f"{outcome}\nreport: {self.report(folder)}"

    def report(self, folder: Path) -> Path:
        """Draw the report of the results in ``folder`` and return its HTML page.

        Raises:
            DigsError: no case succeeded; the message has their errors.
        """
        from digs_warp.engines.task import RESULTS
        from digs_warp.study.engine.store import Store
        from digs_warp.study.page import write_pages

        store = Store(folder)
        records, good = store.records.values(), store.finished()
        if not good:
            errors = "; ".join(sorted({record["error"] for record in records})) or "there are none"
            raise DigsError(
                f"study '{folder / RESULTS}': no case ended well: {errors}; measure some with "
                f"'digs-warp study run {self.name}'"
            )
        machines = " and ".join(sorted({record["machine"] for record in good}))
        intro = f"{self.summary[0].upper()}{self.summary[1:]}. {counted(len(good), 'case')}, "
        intro += f"{len(records) - len(good)} failed. Measured on {machines}."
        return write_pages(self.title, intro, self.module.sections(good), folder)


STUDIES = (
    Study(
        "initialization",
        "Five ways to start",
        "the paper's five initializations: quality along the iterations, points, times",
        objects=6,
        iterations=1000,
    ),
    Study(
        "tradeoff",
        "What accuracy costs in time",
        "each knob of the chain alone, its seconds and its gain, and the front of the best settings",
        objects=2,
        iterations=500,
    ),
    Study(
        "robustness",
        "Errors of the sensor",
        "effects of the simulated camera at rising strength: all together for the five strategies, and each "
        "alone for Highdepth",
        objects=1,
        iterations=300,
    ),
)


def find_study(name: str) -> Study:
    """Return the study of that name.

    Raises:
        DigsError: there is none.
    """
    by_name = {study.name: study for study in STUDIES}
    if name not in by_name:
        raise DigsError(f"study '{name}': no such study{did_you_mean(name, by_name)}")
    return by_name[name]
