"""The studies that ``digs-warp study`` knows. Imports no study: the command line reads its help from here."""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from digs_warp.study.engine.case import Case
    from digs_warp.study.page import Section


@dataclass(frozen=True)
class Study:
    """A question, and the module of `digs_warp.study.studies` that answers it.

    The module has ``cases(objects_count, seeds, iterations)``, those that matter most first, and
    ``sections(records)``, what the report draws.

    Attributes:
        name: as the command line takes it; also the name of the module.
        title: of the report.
        summary: one line for help and report.
        objects, iterations: how much is measured when nothing else is asked for.
    """

    name: str
    title: str
    summary: str
    objects: int
    iterations: int

    @property
    def folder(self) -> Path:
        """Where results and report go when nothing else is asked for."""
        return Path("out") / "study" / self.name

    def cases(self, objects: int, seeds: int, iterations: int) -> "Sequence[Case]":
        """Return the cases."""
        return self._module().cases(objects, seeds, iterations)

    def sections(self, records: Sequence[Any]) -> "Sequence[Section]":
        """Return what the report shows of the records of cases that ended well."""
        return self._module().sections(records)

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
        "each knob of the chain alone, its seconds and what they buy, and the front of the best settings",
        objects=2,
        iterations=500,
    ),
    Study(
        "robustness",
        "Errors of the sensor",
        "the effects of the simulated camera at rising strength: all together for the five strategies, each "
        "alone for Highdepth",
        objects=1,
        iterations=300,
    ),
    Study(
        "ablation",
        "What each component of the start is worth",
        "the paper's Highdepth without one component, or with one addition: points, scale, quality along the "
        "iterations",
        objects=2,
        iterations=1000,
    ),
    Study(
        "segmentation",
        "Wrong masks",
        "spoiled object masks at rising strength, by strategy",
        objects=1,
        iterations=1000,
    ),
    Study(
        "scaling",
        "How the work grows",
        "seconds and memory against frames, pixels, splats and threads, fitted laws, and plans from them",
        objects=1,
        iterations=200,
    ),
)
