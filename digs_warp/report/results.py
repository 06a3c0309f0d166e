"""What a reconstruction folder tells: numbers per view, the course of training, times and settings."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.record.files import read_json
from digs_warp.record.layout import EVALUATION, GAUSSIANS, INITIAL_POINTS, RUN_RECORD, TRAINING

METRICS = ("psnr", "ssim", "psnr_masked", "ssim_masked")


@dataclass(frozen=True, eq=False)
class Results:
    """The contents of a reconstruction folder, but for its images.

    Attributes:
        folder: where it lies.
        views: one record per held-out view, with "name" and the metrics.
        mean: the metrics' means over the views.
        training: one record per logged iteration, ascending.
        splats: number of Gaussians at the end.
        initial_points: number of points at the start; None when the folder does not tell.
        run: the folder's run.json.
    """

    folder: Path
    views: list[dict[str, Any]]
    mean: dict[str, Any]
    training: list[dict[str, Any]]
    splats: int
    initial_points: int | None
    run: dict[str, Any]

    @property
    def evaluations(self) -> list[dict[str, Any]]:
        """The records of training that hold the metrics of the held-out views."""
        return [record for record in self.training if record.get("psnr") is not None]


def read_results(folder: Path) -> Results:
    """Read a reconstruction folder.

    Raises:
        DigsError: a file is missing or broken; the message names it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DigsError(f"reconstruction '{folder}': no such folder")
    path = folder / EVALUATION
    evaluation = read_json(path, "evaluation")
    views, mean = evaluation.get("views"), evaluation.get("mean")
    if not isinstance(views, list) or not isinstance(mean, dict):
        raise DigsError(f"evaluation '{path}': expected 'views' and 'mean'; reconstruct again")
    if any(not isinstance(view, dict) or "name" not in view for view in views):
        raise DigsError(f"evaluation '{path}': every view needs a 'name'; reconstruct again")
    return Results(
        folder=folder,
        views=views,
        mean=mean,
        training=_read_training(folder / TRAINING),
        splats=len(Gaussians.load(folder / GAUSSIANS)),
        initial_points=_count_points(folder / INITIAL_POINTS),
        run=read_json(folder / RUN_RECORD, "run record"),
    )


def _read_training(path: Path) -> list[dict[str, Any]]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DigsError(f"training log '{path}': cannot be read ({error})") from error
    records = []
    for number, line in enumerate(lines, start=1):
        try:
            record = json.loads(line)
            records.append({**record, "iteration": int(record["iteration"])})
        except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
            raise DigsError(
                f"training log '{path}', line {number}: {error}; expected a JSON object with 'iteration'"
            ) from error
    return sorted(records, key=lambda record: record["iteration"])


def _count_points(path: Path) -> int | None:
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return len(arrays["points_world"])
    except (BadZipFile, EOFError, KeyError, OSError, TypeError, ValueError) as error:
        raise DigsError(
            f"initial points '{path}': {error}; expected 'points_world'; reconstruct again"
        ) from error
