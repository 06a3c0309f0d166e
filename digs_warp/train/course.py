"""Training progress: loss and quality by iteration and time, one JSON object per line."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from digs_warp.checks import DigsError
from digs_warp.measure.scores import Score, named_now
from digs_warp.record.fields import Fields, parse_json
from digs_warp.record.files import read_text, write_atomically
from digs_warp.record.typed import COUNT, NOT_STORED, Expect, from_json, to_json


@dataclass(frozen=True)
class CourseRow:
    """The state of a training run at one iteration.

    Attributes:
        iteration: steps taken.
        seconds: of training so far [s].
        loss: of the last step; None before the first.
        splats: number of Gaussians.
        score: mean over the held-out views; None where they were not measured.
        adherence: median distance of the surface to the measured depth [m], see `digs_warp.train.adherence`;
            None where it was not measured.
    """

    iteration: Annotated[int, COUNT]
    seconds: Annotated[float, Expect("seconds", lambda value: value >= 0)]
    loss: float | None
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
