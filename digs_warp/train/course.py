"""How a training run goes along: a line of training.jsonl every few iterations."""

import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from digs_warp.record.files import write_atomically
from digs_warp.train.evaluate import TestView, mean_score, render_views, score_views
from digs_warp.train.snapshots import drop_snapshots_after, save_snapshot
from digs_warp.train.trainer import Trainer

# A line every so many iterations.
LOG_EVERY = 10


class Course:
    """Writes how loss and quality go along iterations and seconds.

    Args:
        path: the file, one JSON object a line; lines up to the trainer's iteration are kept.
        trainer: the run.
        test_views: held-out views to measure; may be empty.

    Attributes:
        seconds: time spent in `record` so far: measuring the course is no training.
        psnr: what the held-out views reached last [dB], minus infinity before they are measured.
    """

    def __init__(self, path: Path, trainer: Trainer, test_views: Sequence[TestView]) -> None:
        self.seconds = 0.0
        self.psnr = -math.inf
        self._path = path
        self._trainer = trainer
        self._test_views = test_views
        self._lines = self._lines_before(trainer.optimizer.step)
        drop_snapshots_after(path.parent, trainer.optimizer.step)

    def record(self, measure: bool) -> str:
        """Add a line; return a few words for the progress bar.

        Args:
            measure: also render and score the held-out views, and keep the Gaussians where asked to.
        """
        start = time.perf_counter()
        trainer = self._trainer
        step = trainer.optimizer.step
        if measure and trainer.config.keep_course:
            save_snapshot(self._path.parent, step, trainer.gaussians.to_numpy())
        line: dict[str, Any] = {
            "iteration": step,
            "seconds": round(trainer.seconds, 4),
            "loss": trainer.loss_value() if step else None,
            "splats": len(trainer.gaussians),
        }
        if measure and self._test_views:
            images = render_views(trainer.gaussians, self._test_views)
            line |= mean_score(score_views(images, self._test_views))
            self.psnr = line["psnr"]
        self._lines.append(json.dumps(line))
        write_atomically(self._path, ("\n".join(self._lines) + "\n").encode())
        self.seconds += time.perf_counter() - start
        return self._in_words(line["loss"])

    def _in_words(self, loss: float | None) -> str:
        words = [] if loss is None else [f"loss {loss:.4f}"]
        if self.psnr > -math.inf:
            words.append(f"held out {self.psnr:.1f} dB")
        return ", ".join(words)

    def _lines_before(self, step: int) -> list[str]:
        """The lines of an interrupted run up to the checkpoint it goes on from."""
        if step == 0 or not self._path.is_file():
            return []
        lines = self._path.read_text(encoding="utf-8").splitlines()
        return [line for line in lines if json.loads(line)["iteration"] <= step]
