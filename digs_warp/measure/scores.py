"""How well rendered views match photographs that the training never saw."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any

import numpy as np

from digs_warp.record.fields import Fields
from digs_warp.record.results import Figure
from digs_warp.record.typed import NOT_STORED, from_json, to_json
from digs_warp.words import counted


@dataclass(frozen=True)
class SurfaceError:
    """Mean distances between the rendered and the true surface [m]."""

    accuracy: float  # from the rendered one
    completeness: float  # from the true one; what no camera saw counts
    seen_completeness: float | None = (
        None  # of what cameras saw alone; None where that is not known
    )

    def __str__(self) -> str:
        known = (
            f"accuracy {1e3 * self.accuracy:.2f} mm, completeness {1e3 * self.completeness:.2f} mm"
        )
        if self.seen_completeness is None:
            return known
        return f"{known} ({1e3 * self.seen_completeness:.2f} mm of what cameras see)"


@dataclass(frozen=True, kw_only=True)
class Score:
    """PSNR [dB] and SSIM on the object's pixels, and over the whole frame on white; NaN if undefined.

    The object comes first: most of a frame is white paper, which says nothing about the result. ``aligned``:
    after the photograph's exposure, white balance and tone were fitted, see `digs_warp.measure.color_gain`.
    """

    psnr_object: float = math.nan
    ssim_object: float = math.nan
    psnr_object_aligned: float = math.nan
    psnr_frame: float = math.nan
    ssim_frame: float = math.nan
    psnr_frame_aligned: float = math.nan

    def to_json(self) -> dict[str, float | None]:
        """Return the metrics by name; None for NaN, which JSON lacks."""
        return to_json(self)


METRICS = tuple(metric.name for metric in fields(Score))

# Names in files of earlier versions.
_NAMED_BEFORE = {
    "psnr": "psnr_frame",
    "ssim": "ssim_frame",
    "psnr_masked": "psnr_object",
    "ssim_masked": "ssim_object",
}


def named_now(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return measured values with the metrics of earlier versions under their names of today."""
    return {_NAMED_BEFORE.get(name, name): value for name, value in content.items()}


@dataclass(frozen=True, kw_only=True)
class ViewScore(Score):
    """The score of one view, with the name of its frame."""

    name: str


@dataclass(frozen=True, kw_only=True)
class OtherSizes:
    """PSNR on the object [dB] of the same views from four distances, color-aligned; NaN if undefined.

    The further away, the smaller the image of the object. Photographs have one size: what is finer,
    photograph or drawing, is averaged over the area of each pixel of the other.

    Attributes:
        views: how many were drawn.
        trained: at the size of the photographs.
        half: at half that size, from twice the distance.
        four_thirds: at 4/3 of that size, from three quarters of the distance.
        double: at twice that size, from half the distance.
    """

    views: int = 0
    trained: float = math.nan
    half: float = math.nan
    four_thirds: float = math.nan
    double: float = math.nan

    def __str__(self) -> str:
        """Return one phrase; empty where nothing is known."""
        named = {
            "as trained": self.trained,
            "from 3/4 of the distance": self.four_thirds,
            "from half the distance": self.double,
            "from twice the distance": self.half,
        }
        known = {name: value for name, value in named.items() if not math.isnan(value)}
        return ", ".join(f"{value:.2f} dB {name}" for name, value in known.items())


@dataclass(frozen=True)
class UnseenPart:
    """What held-out views of a scene show that no training view does: there is nothing to learn it from.

    Attributes:
        share: of their pixels, 0 to 1.
        psnr_unseen: of these, the mean over the views that have some [dB].
        psnr_seen: of the others, the same [dB]; NaN: there are none.
    """

    share: float
    psnr_unseen: float
    psnr_seen: float = math.nan

    def __str__(self) -> str:
        return (
            f"{self.share:.1%} of their pixels, {self.psnr_unseen:.2f} dB; "
            f"{self.psnr_seen:.2f} dB on the others"
        )


@dataclass(frozen=True)
class Scores:
    """The record of the evaluation; empty if nothing was measured.

    Attributes:
        views: of every held-out view; evaluation.json has them.
        mean: of each metric over the views where it is defined.
        surface: how far the surface is from the true one; None where that is not known.
        other_sizes: how some of the views look from other distances; None where that was not measured.
        unseen: of a scene; None where training views see all that held-out ones show.
    """

    views: Annotated[tuple[ViewScore, ...], NOT_STORED] = ()
    mean: Score = Score()
    surface: Annotated[SurfaceError | None, Figure("surface")] = None
    other_sizes: Annotated[OtherSizes | None, Figure("PSNR from other distances")] = None
    unseen: Annotated[UnseenPart | None, Figure("seen by no training view")] = None

    @staticmethod
    def of(
        views: Sequence[ViewScore],
        surface: SurfaceError | None = None,
        other_sizes: OtherSizes | None = None,
        unseen: UnseenPart | None = None,
    ) -> "Scores":
        """Return the record of some views."""
        return Scores(tuple(views), mean_score(views), surface, other_sizes, unseen)

    def __str__(self) -> str:
        """Return one phrase for summaries, of an object."""
        return self.words()

    def words(self, has_object: bool = True) -> str:
        """Return one phrase for summaries.

        Args:
            has_object: False: the whole frame was reconstructed, so its figures are the only ones.
        """
        mean = self.mean
        if not has_object:
            figures = _figures(mean.psnr_frame, mean.ssim_frame, mean.psnr_frame_aligned)
            views, seen = counted(len(self.views), "held-out view"), ""
            if self.unseen and self.unseen.psnr_seen > mean.psnr_frame + OTHER_EXPOSURE:
                seen = f" ({self.unseen.psnr_seen:.2f} dB where training views see)"
            return f"{figures} over the frame in {views}{seen}"
        figures = _figures(mean.psnr_object, mean.ssim_object, mean.psnr_object_aligned)
        on_object = f"{figures} on the object"
        frame = "" if math.isnan(mean.psnr_frame) else f" ({mean.psnr_frame:.2f} dB over the frame)"
        return f"{on_object} in {counted(len(self.views), 'held-out view')}{frame}"

    def to_json(self) -> dict[str, Any]:
        """Return the views and their mean, as evaluation.json holds them."""
        views = [{"name": view.name} | view.to_json() for view in self.views]
        return {"views": views, "mean": self.mean.to_json()}

    @staticmethod
    def from_json(content: Any) -> "Scores":
        """Return what `to_json` wrote.

        Raises:
            DigsError: it has a different form.
        """
        scores = Fields.of(content, "scores")
        # The mean is stored for other readers; we compute it from the views.
        from_json(Score, named_now(scores.section("mean").values), "scores, mean")
        views = scores.sections("views")
        return Scores.of([from_json(ViewScore, named_now(v.values), v.where) for v in views])


# Where held-out views match by so much more [dB] in their own exposure, this is what they are said to match.
OTHER_EXPOSURE = 1.0


def _figures(psnr: float, ssim: float, aligned: float) -> str:
    words = [] if math.isnan(psnr) else [f"PSNR {psnr:.2f} dB"]
    if aligned > psnr + OTHER_EXPOSURE:
        words = [f"PSNR {aligned:.2f} dB in their own exposures ({psnr:.2f} dB in one)"]
    words += [] if math.isnan(ssim) else [f"SSIM {ssim:.4f}"]
    return " and ".join(words) or "no measure"


def mean_score(scores: Sequence[Score]) -> Score:
    """Return the mean of each metric over the scores where it is defined."""
    means: dict[str, float] = {}
    for name in METRICS:
        values = np.array([getattr(score, name) for score in scores], dtype=np.float64)
        values = values[np.isfinite(values)]
        means[name] = float(values.mean()) if len(values) else math.nan
    return Score(**means)
