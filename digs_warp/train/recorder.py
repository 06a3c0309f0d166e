"""Records the progress of a training run: one line of training.jsonl every few iterations."""

import math
import time
from collections.abc import Sequence
from pathlib import Path

from digs_warp.measure.scores import mean_score
from digs_warp.train.adherence import MeasuredView, adherence
from digs_warp.train.evaluate import MeasuredViews, TestView, measure_views
from digs_warp.train.trainer import Trainer
from digs_warp.train.training import (
    CourseRow,
    drop_snapshots_after,
    read_course,
    save_snapshot,
    write_course,
)

# Iterations between two lines.
LOG_EVERY = 10


class CourseRecorder:
    """Writes loss and quality by iteration and time.

    Args:
        path: the file, one JSON object per line; lines up to the trainer's iteration are kept.
        trainer: the run.
        test_views: held-out views to measure; may be empty.
        measured_views: measured depth to compare the surface with; may be empty.

    Attributes:
        rows: what was recorded so far.
        seconds: time spent in `record` so far, which does not count as training.
        psnr: last PSNR on the object in the held-out views [dB], minus infinity before they are measured.
        measured: the held-out views as the last line found them; None if it did not measure them.
    """

    def __init__(
        self,
        path: Path,
        trainer: Trainer,
        test_views: Sequence[TestView],
        measured_views: Sequence[MeasuredView] = (),
    ) -> None:
        step = trainer.optimizer.step
        # A resumed run keeps the rows up to its checkpoint.
        before = read_course(path) if step and path.is_file() else ()
        self.rows = [row for row in before if row.iteration <= step]
        self.seconds = 0.0
        self.psnr = -math.inf
        self.measured: MeasuredViews | None = None
        self._path = path
        self._trainer = trainer
        self._test_views = test_views
        self._measured_views = measured_views
        drop_snapshots_after(path.parent, step)

    def record(self, measure: bool) -> str:
        """Add a line; return a short text for the progress bar.

        Args:
            measure: also score the held-out views, measure the adherence, and keep the Gaussians if the
                settings say so.
        """
        start = time.perf_counter()
        trainer = self._trainer
        step = trainer.optimizer.step
        if measure and trainer.config.keep_course:
            save_snapshot(self._path.parent, step, trainer.gaussians.to_numpy())
        self.measured = None
        found = self._measure() if measure else None
        row = CourseRow(
            iteration=step,
            seconds=round(trainer.seconds, 4),
            loss=trainer.loss_value() if step else None,
            splats=len(trainer.gaussians),
            score=mean_score(self.measured.scores) if self.measured else None,
            adherence=found,
        )
        if row.score:
            self.psnr = row.score.psnr_object
        self.rows.append(row)
        write_course(self._path, self.rows)
        self.seconds += time.perf_counter() - start
        return self._in_words(row.loss)

    def _measure(self) -> float | None:
        """Measure the held-out views; return the adherence."""
        gaussians, views = self._trainer.gaussians, self._test_views
        self.measured = measure_views(gaussians, views) if views else None
        return adherence(gaussians, self._measured_views)

    def _in_words(self, loss: float | None) -> str:
        words = [] if loss is None else [f"loss {loss:.4f}"]
        if self.psnr > -math.inf:
            words.append(f"held out {self.psnr:.1f} dB")
        return ", ".join(words)
