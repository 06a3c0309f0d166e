"""The studies of ``digs-warp study``; imports none of them, because the command line reads this."""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.checks import DigsError
from digs_warp.words import counted, did_you_mean

if TYPE_CHECKING:
    from digs_warp.study.engine.case import Case
    from digs_warp.study.page import Section


@dataclass(frozen=True)
class Study:
    """A question, and the module of `digs_warp.study.studies` that answers it.

    The module has ``cases(objects_count, seeds, iterations)``, the most important first, and
    ``sections(records)``, the content of the report.

    Attributes:
        name: as the command line takes it; also the name of the module, there with underscores.
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

    def cases(self, objects: int, seeds: int, iterations: int) -> "Sequence[Case]":
        """Return the cases."""
        return self._module().cases(objects, seeds, iterations)

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
                f"study '{folder / RESULTS}': no case ended well: {errors}; measure some with 'digs-warp "
                f"study run {self.name}'"
            )
        failed = len(records) - len(good)
        intro = f"{self.summary[0].upper()}{self.summary[1:]}. {counted(len(good), 'case')}"
        intro += f", {failed} failed." if failed else "."
        machines = sorted({record["machine"] for record in good})
        intro += f" Measured on {' and '.join(machines)}."
        return write_pages(self.title, intro, self.sections(good), folder)

    def _module(self) -> Any:
        name = self.name.replace("-", "_")
        return importlib.import_module(f"digs_warp.study.studies.{name}")


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
    Study(
        "ablation",
        "The value of each component of the start",
        "the paper's Highdepth without one component, or with one addition: points, scale, quality along the "
        "iterations",
        objects=2,
        iterations=1000,
    ),
    Study(
        "camera",
        "The camera in the training",
        "what the training knows of exposure, poses, shutter, blur, rims, depth and gloss: nothing, "
        "everything, and all but one part, for six kinds of recordings",
        objects=6,
        iterations=300,
    ),
    Study(
        "segmentation",
        "Wrong masks",
        "spoiled object masks at rising strength, by strategy",
        objects=1,
        iterations=1000,
    ),
    Study(
        "few-views",
        "Few views",
        "3 to 24 views: a start from the sensor's depth beside sparse and random points, with and without "
        "depth in the loss",
        objects=6,
        iterations=500,
    ),
    Study(
        "scaling",
        "How the work grows",
        "seconds and memory by frames, pixels, splats and threads, with fitted laws and plans from them",
        objects=1,
        iterations=200,
    ),
)


def find_study(name: str) -> Study:
    """Return the study of that name.

    Raises:
        DigsError: there is none.
    """
    for study in STUDIES:
        if study.name == name:
            return study
    known = [study.name for study in STUDIES]
    raise DigsError(f"study '{name}': no such study{did_you_mean(name, known)}")
