"""What a training leaves beside the Gaussians: its record, the course of its quality, and snapshots.

The course (training.jsonl) has loss and quality by iteration and time, one JSON object per line. Snapshots
keep the base color only, without view dependence: 56 bytes per splat, a quarter of the size at degree 3.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.init.view_dependence import ViewDependence
from digs_warp.measure.scores import Score, named_now
from digs_warp.record.fields import Fields, parse_json
from digs_warp.record.files import read_text, remove, write_atomically
from digs_warp.record.layout import COURSE
from digs_warp.record.results import Figure
from digs_warp.record.typed import COUNT, NOT_STORED, Expect, from_json, to_json
from digs_warp.train.shutter import MotionPlan


@dataclass(frozen=True)
class CourseRow:
    """The state of a training run at one iteration; what was not measured is None.

    The score is the mean over the held-out views; adherence [m] is that of `digs_warp.train.adherence`.
    """

    iteration: Annotated[int, COUNT]  # steps taken
    seconds: Annotated[float, Expect("seconds", lambda value: value >= 0)]  # of training so far
    loss: float | None  # of the last step
    splats: Annotated[int, COUNT]
    score: Annotated[Score | None, NOT_STORED] = None
    adherence: Annotated[float | None, Expect("metres", lambda value: value >= 0)] = None

    def to_json(self) -> dict[str, Any]:
        """Return the row as flat JSON values."""
        return to_json(self) | (self.score.to_json() if self.score else {})

    @cached_property
    def line(self) -> str:
        """The row as a line of JSON, cached: a long run writes it many times."""
        return json.dumps(self.to_json()) + "\n"

    @staticmethod
    def from_json(content: Any) -> "CourseRow":
        """Return what `to_json` wrote.

        Raises:
            DigsError: it has a different form.
        """
        row = named_now(Fields.of(content, "row").values)
        score = from_json(Score, row, "row") if "psnr_frame" in row else None
        return from_json(CourseRow, row, "row", score=score)


def write_course(path: Path, rows: Iterable[CourseRow]) -> None:
    """Write one line per row; the file appears only when it is complete."""
    write_atomically(path, "".join(row.line for row in rows).encode())


def read_course(path: Path) -> tuple[CourseRow, ...]:
    """Return the rows that `write_course` wrote, in ascending order.

    Raises:
        DigsError: the file is missing or broken; the message names the file and the line.
    """
    rows = []
    for number, line in enumerate(read_text(path, "training log").splitlines(), start=1):
        try:
            rows.append(CourseRow.from_json(parse_json(line)))
        except ValueError as error:
            raise DigsError(
                f"training log '{path}', line {number}: {error}; expected a JSON object with 'iteration', "
                "'seconds', 'loss' and 'splats'"
            ) from error
    return tuple(sorted(rows, key=lambda row: row.iteration))


@dataclass(frozen=True)
class TimePlan:
    """What was chosen for a time budget."""

    iterations: int  # steps that fit, at least one
    budget: float  # time for the steps [s]
    step_seconds: float  # time of a step, as measured [s]

    def __str__(self) -> str:
        return f"{self.iterations:,} iterations: a step takes {1e3 * self.step_seconds:.0f} ms"


@dataclass(frozen=True, eq=False, kw_only=True)
class Training:
    """The record of a training.

    Attributes:
        course: one row every few iterations, the last one from the end; training.jsonl has them.
        rolling_shutter: whether the training drew it, and why.
        motion_blur: the same.
        view_dependence: the degree of the color that the photographs called for; None: the settings said
            which.
        gaussians: how many there are at the end.
        plan: what was chosen for the time budget, where there is one.
        iterations: steps taken.
        stopped_by: what ended it: "iterations" or "time budget".
        training_seconds: of the steps alone [s].
        exposure_stops: root mean square of the photographs' gains [stops]: how much their exposure and white
            balance vary; 0 where they are known to be constant, None if they were not fitted.
        adherence: median distance of the surface to the measured depth [m]; None where none was measured.
    """

    course: Annotated[tuple[CourseRow, ...], NOT_STORED] = ()
    rolling_shutter: Annotated[MotionPlan | None, Figure("rolling shutter")] = None
    motion_blur: Annotated[MotionPlan | None, Figure("motion blur")] = None
    view_dependence: Annotated[ViewDependence | None, Figure("view-dependent color")] = None
    gaussians: int | None = None
    plan: Annotated[TimePlan | None, Figure("planned for the time budget")] = None
    iterations: Annotated[int | None, Figure("iterations")] = None
    stopped_by: Annotated[str | None, Figure("training ended by")] = None
    training_seconds: Annotated[float | None, Figure("training", "s", digits=1)] = None
    exposure_stops: Annotated[float | None, Figure("exposure varies by", "stops", digits=3)] = None
    adherence: Annotated[
        float | None, Figure("adherence to the measured depth", "mm", factor=1e3)
    ] = None


def save_snapshot(folder: Path, iteration: int, gaussians: Gaussians) -> None:
    """Save the Gaussians of an iteration in the folder of a reconstruction."""
    plain = replace(gaussians, sh=gaussians.sh[:, :1])
    plain.save(folder / COURSE / f"{iteration:08d}.npz")


def load_snapshots(folder: Path) -> tuple[tuple[int, Gaussians], ...]:
    """Return (iteration, Gaussians) in ascending order; empty if none were saved.

    Raises:
        DigsError: a file is truncated or lacks a field.
    """
    return tuple((int(path.stem), Gaussians.load(path)) for path in _files(folder))


def drop_snapshots_after(folder: Path, iteration: int) -> None:
    """Delete the snapshots after ``iteration``, from which a run now continues (0: from the start)."""
    for path in _files(folder):
        if int(path.stem) > iteration or iteration == 0:
            remove(path)


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / COURSE).glob("*.npz") if path.stem.isdecimal())
