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
    from digs_warp.study.page import Section


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

    def cases(
        self, objects: int, seeds: int, iterations: int, meshes: Sequence[Path] = ()
    ) -> "Sequence[Case]":
        """Return the cases for that many objects: sample objects, or ``meshes``, files of one's own."""
        from digs_warp.study.scenes import objects as named

        return self._module().cases(named(objects, meshes), seeds, iterations)

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

        if folder.is_dir() and any(folder.iterdir()):
            if not any((folder / name).exists() for name in (RESULTS, CAPTURES)):
                raise DigsError(
                    f"--out '{folder}': the folder is not empty and holds no study; name another folder"
                )
        outcome = run_cases(cases, folder, measure=run_case, engine=engine, budget=budget)
        return f"{outcome}\nreport: {self.report(folder)}"

    def sections(self, records: Sequence[Any]) -> "Sequence[Section]":
        """Return the content of the report for the records of successful cases."""
        return self._module().sections(records)

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
        failed = len(records) - len(good)
        intro = f"{self.summary[0].upper()}{self.summary[1:]}. {counted(len(good), 'case')}"
        intro += f", {failed} failed." if failed else "."
        machines = sorted({record["machine"] for record in good})
        intro += f" Measured on {' and '.join(machines)}."
        return write_pages(self.title, intro, self.sections(good), folder)

    def _module(self) -> Any:
        return importlib.import_module(f"digs_warp.study.studies.{self.name}")


STUDIES = (
    Study(
        "initialization",
        "Five ways to start",
        "the paper's tables 2 to 4: five initializations, quality along the iterations, times",
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


def find_study(name: str, studies: Sequence[Study] = STUDIES) -> Study:
    """Return the study of that name.

    Raises:
        DigsError: there is none.
    """
    by_name = {study.name: study for study in studies}
    if name not in by_name:
        raise DigsError(f"study '{name}': no such study{did_you_mean(name, by_name)}")
    return by_name[name]
