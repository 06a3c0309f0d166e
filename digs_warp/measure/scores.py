"""How well rendered views match photographs that the training never saw."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from digs_warp.record.fields import Fields
from digs_warp.words import counted


@dataclass(frozen=True, kw_only=True)
class Score:
    """PSNR [dB] and SSIM over the whole view and inside the object's mask; NaN if undefined.

    ``aligned``: after the photograph's exposure and white balance were fitted, see
    `digs_warp.measure.color_gain`.
    """

    psnr: float = math.nan
    ssim: float = math.nan
    psnr_masked: float = math.nan
    ssim_masked: float = math.nan
    psnr_aligned: float = math.nan
    psnr_masked_aligned: float = math.nan

    def to_json(self) -> dict[str, float | None]:
        """Return the metrics by name; None for NaN, which JSON lacks."""
        values = {name: getattr(self, name) for name in METRICS}
        return {name: None if math.isnan(value) else value for name, value in values.items()}

    @staticmethod
    def from_json(content: Any) -> "Score":
        """Return what `to_json` wrote.

        Raises:
            DigsError: a metric is not a number.
        """
        return Score(**_metrics(Fields.of(content, "scores")))


METRICS = tuple(metric.name for metric in fields(Score))


@dataclass(frozen=True, kw_only=True)
class ViewScore(Score):
    """The score of one view, with the name of its frame."""

    name: str


@dataclass(frozen=True)
class Scores:
    """The scores of all held-out views; empty if nothing was measured."""

    views: tuple[ViewScore, ...] = ()

    @property
    def mean(self) -> Score:
        """The mean of each metric over the views where it is defined."""
        return mean_score(self.views)

    def __str__(self) -> str:
        """Return one phrase for summaries."""
        mean = self.mean
        words = [] if math.isnan(mean.psnr) else [f"PSNR {mean.psnr:.2f} dB"]
        words += [] if math.isnan(mean.ssim) else [f"SSIM {mean.ssim:.4f}"]
        return (
            f"{' and '.join(words) or 'no measure'} on {counted(len(self.views), 'held-out view')}"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the views and their mean."""
        views = [{"name": view.name, **view.to_json()} for view in self.views]
        return {"views": views, "mean": self.mean.to_json()}

    @staticmethod
    def from_json(content: Any) -> "Scores":
        """Return what `to_json` wrote.

        Raises:
            DigsError: it has a different form.
        """
        scores = Fields.of(content, "scores")
        _metrics(scores.section("mean"))  # stored for other readers; we compute it from the views
        views = scores.sections("views")
        return Scores(tuple(ViewScore(name=view.text("name"), **_metrics(view)) for view in views))


def mean_score(scores: Sequence[Score]) -> Score:
    """Return the mean of each metric over the scores where it is defined."""
    means: dict[str, float] = {}
    for name in METRICS:
        values = np.array([getattr(score, name) for score in scores], dtype=np.float64)
        values = values[np.isfinite(values)]
        means[name] = float(values.mean()) if len(values) else math.nan
    return Score(**means)


def _metrics(fields: Fields) -> dict[str, float]:
    return {name: fields.number(name, default=math.nan) for name in METRICS}
