"""The results in a reconstruction's run.json: counts and figures that no other file has."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.scale import ScaleEstimate
from digs_warp.init.start import DepthReport, Initialization
from digs_warp.measure.scores import Score
from digs_warp.record.run_log import RunRecord
from digs_warp.sfm.quality import SfmQuality


@dataclass(frozen=True, kw_only=True)
class Results:
    """What is known so far; each stage of a reconstruction adds its part.

    Attributes:
        capture: folder of the recording.
        doubts: what does not fit together in the recording.
        sfm: quality of structure from motion, where images were matched.
        scale: of the estimated poses, where there are such.
        sources: number of initial points by where they came from: "depth", "sfm", "random".
        depth: how many pixels of the depth maps were used, if the start is from depth.
        initial_points, gaussians: how many.
        iterations: training steps.
        stopped_by: what ended the training.
        training_seconds: of the steps alone [s].
        held_out: mean over the held-out views.
    """

    capture: Path | None = None
    doubts: tuple[str, ...] = ()
    sfm: SfmQuality | None = None
    scale: ScaleEstimate | None = None
    sources: dict[str, int] | None = None
    depth: DepthReport | None = None
    initial_points: int | None = None
    gaussians: int | None = None
    iterations: int | None = None
    stopped_by: str | None = None
    training_seconds: float | None = None
    held_out: Score | None = None

    @staticmethod
    def of_start(
        capture: Path | None,
        start: Initialization | None,
        sfm: SfmQuality | None,
        scale: ScaleEstimate | None,
    ) -> "Results":
        """Return what is known before the training."""
        known = Results(capture=capture, sfm=sfm, scale=scale)
        if start is None:
            return known
        count = len(start.points)
        return replace(known, sources=start.sources, depth=start.depth, initial_points=count)

    def start(self, points: PointCloud) -> Initialization:
        """Return the initial points with what is known about their origin."""
        return Initialization(points, self.sources or {}, self.depth)

    def to_json(self) -> dict[str, Any]:
        """Return what is known as JSON values, by the names that run.json has for them."""
        start = None
        if self.sources is not None:
            start = {"sources": self.sources, **(asdict(self.depth) if self.depth else {})}
        content = {
            "capture": str(self.capture) if self.capture else None,
            "doubts": list(self.doubts) or None,
            "sfm": asdict(self.sfm) if self.sfm else None,
            "scale": asdict(self.scale) if self.scale else None,
            "initialization": start,
            "initial_points": self.initial_points,
            "gaussians": self.gaussians,
            "iterations": self.iterations,
            "stopped by": self.stopped_by,
            "training_seconds": self.training_seconds,
            "held_out": self.held_out.to_json() if self.held_out else None,
        }
        return {name: value for name, value in content.items() if value is not None}

    @staticmethod
    def read(record: RunRecord, path: Path) -> "Results":
        """Return what `to_json` wrote into a record; ``path`` is its file, for messages.

        Raises:
            DigsError: an entry has another form.
        """
        content = record.results
        start = dict(content.get("initialization") or {})
        try:
            return Results(
                capture=Path(content["capture"]) if "capture" in content else None,
                doubts=tuple(map(str, content.get("doubts", ()))),
                sfm=SfmQuality(**content["sfm"]) if "sfm" in content else None,
                scale=ScaleEstimate(**content["scale"]) if "scale" in content else None,
                sources=start.pop("sources", None),
                depth=DepthReport(**start) if start else None,
                initial_points=content.get("initial_points"),
                gaussians=content.get("gaussians"),
                iterations=content.get("iterations"),
                stopped_by=content.get("stopped by"),
                training_seconds=content.get("training_seconds"),
                held_out=Score.from_json(content["held_out"]) if "held_out" in content else None,
            )
        except (AttributeError, TypeError, ValueError) as error:
            raise DigsError(f"run record '{path}': results: {error}; reconstruct again") from error
