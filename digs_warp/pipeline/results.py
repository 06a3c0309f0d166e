"""The results in a reconstruction's run.json: counts and figures that no other file has."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from digs_warp.data.metric_scale import MetricScale
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.sh import MAX_DEGREE
from digs_warp.init.scale import ScaleEstimate
from digs_warp.init.start import DepthReport, Initialization, Subject
from digs_warp.init.view_dependence import ViewDependence
from digs_warp.measure.scores import Score
from digs_warp.poses.from_images.quality import SfmQuality
from digs_warp.poses.refinement import PoseRefinement
from digs_warp.poses.tracking import Tracking
from digs_warp.record.fields import Fields
from digs_warp.record.run_log import RunRecord
from digs_warp.surface.error import SurfaceError
from digs_warp.train.blur_plan import NO_BLUR, BlurPlan
from digs_warp.train.shutter import ShutterPlan

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Results:
    """What is known so far; each stage of a reconstruction adds its part.

    Attributes:
        capture: folder of the recording.
        doubts: what does not fit together in the recording.
        subject: what was reconstructed, the object in the masks or the whole scene.
        metric_scale: whether lengths are in metres, and how that is known.
        sfm: quality of structure from motion, where images were matched.
        scale: of the estimated poses, where there are such.
        sources: number of initial points by where they came from; see `Initialization`.
        because: what they are and why, in words.
        depth: how many pixels of the depth maps were used, if the start is from depth.
        refinement: whether the poses were refined, and why.
        tracking: how well poses found by color and depth fit together, where they were.
        shutter: whether the training draws the rolling shutter, and why.
        color: the degree of the color that the photographs call for; None: the settings said which.
        initial_points, gaussians: how many.
        iterations: training steps.
        stopped_by: what ended the training.
        training_seconds: of the steps alone [s].
        exposure_stops: how much the exposure and white balance of the photographs vary: root mean square of
            their fitted gains [stops]; 0 where they are known to be constant.
        tone_lift: that of their fitted lifts [sRGB, 0 to 1]; 0 where the tone is constant.
        held_out: mean over the held-out views.
        adherence: median distance of the surface to the measured depth [m].
        surface: how far the surface is from the true one, where that is known.
    """

    capture: Path | None = None
    doubts: tuple[str, ...] = ()
    subject: Subject = "object"
    metric_scale: MetricScale | None = None
    sfm: SfmQuality | None = None
    scale: ScaleEstimate | None = None
    sources: dict[str, int] | None = None
    because: str | None = None
    depth: DepthReport | None = None
    refinement: PoseRefinement | None = None
    tracking: Tracking | None = None
    shutter: ShutterPlan | None = None
    color: ViewDependence | None = None
    initial_points: int | None = None
    gaussians: int | None = None
    iterations: int | None = None
    stopped_by: str | None = None
    training_seconds: float | None = None
    exposure_stops: float | None = None
    tone_lift: float | None = None
    held_out: Score | None = None
    adherence: float | None = None
    surface: SurfaceError | None = None

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
        return replace(
            known,
            sources=start.sources,
            because=start.because or None,
            depth=start.depth,
            initial_points=count,
        )

    def start(self, points: PointCloud) -> Initialization:
        """Return the initial points with what is known about their origin."""
        return Initialization(points, self.sources or {}, self.depth, self.because or "")

    def to_json(self) -> dict[str, Any]:
        """Return what is known as JSON values, by the names that run.json has for them."""
        start = None
        if self.sources is not None:
            start = {"sources": self.sources, **(asdict(self.depth) if self.depth else {})}
            start |= {"because": self.because} if self.because else {}
        content = {
            "capture": str(self.capture) if self.capture else None,
            "doubts": list(self.doubts) or None,
            "subject": self.subject,
            "metric_scale": asdict(self.metric_scale) if self.metric_scale else None,
            "sfm": asdict(self.sfm) if self.sfm else None,
            "scale": asdict(self.scale) if self.scale else None,
            "initialization": start,
            "pose_refinement": asdict(self.refinement) if self.refinement else None,
            "tracking": asdict(self.tracking) if self.tracking else None,
            "rolling_shutter": self.shutter.to_json() if self.shutter else None,
            "motion_blur": self.shutter.blur.to_json() if self.shutter else None,
            "view_dependence": self.color.to_json() if self.color else None,
            "initial_points": self.initial_points,
            "gaussians": self.gaussians,
            "iterations": self.iterations,
            "stopped by": self.stopped_by,
            "training_seconds": self.training_seconds,
            "exposure_stops": self.exposure_stops,
            "tone_lift": self.tone_lift,
            "held_out": self.held_out.to_json() if self.held_out else None,
            "adherence": self.adherence,
            "surface": asdict(self.surface) if self.surface else None,
        }
        return {name: value for name, value in content.items() if value is not None}

    @staticmethod
    def read(record: RunRecord, path: Path) -> "Results":
        """Return what `to_json` wrote into a record; ``path`` is its file, for messages.

        Raises:
            DigsError: an entry has another form.
        """
        where = f"run record '{path}', results"
        found = Fields(record.results, where, remedy="reconstruct again")
        start = found.section("initialization", optional=True)
        sources = start.section("sources", optional=True)
        capture = found.text("capture", None)
        return Results(
            capture=Path(capture) if capture else None,
            doubts=found.texts("doubts"),
            subject="scene" if found.text("subject", None) == "scene" else "object",
            metric_scale=_dataclass(MetricScale, found, "metric_scale"),
            sfm=_dataclass(SfmQuality, found, "sfm"),
            scale=_dataclass(ScaleEstimate, found, "scale"),
            sources={name: sources.whole(name) for name in sources.values}
            if "sources" in start
            else None,
            because=start.text("because", None),
            depth=_depth_report(start),
            refinement=_refinement(found),
            tracking=_dataclass(Tracking, found, "tracking"),
            shutter=_shutter(found),
            color=_color(found),
            initial_points=found.whole("initial_points", default=None),
            gaussians=found.whole("gaussians", default=None),
            iterations=found.whole("iterations", default=None),
            stopped_by=found.text("stopped by", None),
            training_seconds=found.number("training_seconds", default=None),
            exposure_stops=found.number("exposure_stops", 0, default=None),
            tone_lift=found.number("tone_lift", 0, default=None),
            held_out=Score.from_json(found.section("held_out").values)
            if "held_out" in found
            else None,
            adherence=found.number("adherence", 0, default=None, what="metres"),
            surface=_surface(found),
        )


def _dataclass(kind: type[T], found: Fields, name: str) -> T | None:
    """Return a dataclass of numbers and texts, all of them needed; None where it is missing."""
    if name not in found:
        return None
    section = found.section(name)
    hints = get_type_hints(kind)
    readers = {int: section.whole, float: section.number, str: section.text, bool: section.flag}
    return kind(**{field: readers[hint](field) for field, hint in hints.items()})


def _refinement(found: Fields) -> PoseRefinement | None:
    if "pose_refinement" not in found:
        return None
    entry = found.section("pose_refinement")
    return PoseRefinement(
        refined=entry.flag("refined"),
        because=entry.text("because"),
        moved_mm=entry.number("moved_mm", 0),
        turned_deg=entry.number("turned_deg", 0),
        in_training=entry.flag("in_training", default=False),
        adjusted=entry.flag("adjusted", default=False),
    )


def _shutter(found: Fields) -> ShutterPlan | None:
    if "rolling_shutter" not in found:
        return None
    plan = found.section("rolling_shutter")
    return ShutterPlan(
        rolling=plan.flag("rolling"),
        because=plan.text("because"),
        readout_time=plan.number("readout_time", 0),
        skew_px=plan.number("skew_px", 0, default=None),
        blur=_blur(found),
    )


def _blur(found: Fields) -> BlurPlan:
    if "motion_blur" not in found:
        return NO_BLUR
    blur = found.section("motion_blur")
    return BlurPlan(
        blur.text("because"),
        blur.number("blur_px", 0, default=None),
        blur.whole("frames"),
        blur.whole("moments", 1),
    )


def _surface(found: Fields) -> SurfaceError | None:
    if "surface" not in found:
        return None
    distances = found.section("surface")
    return SurfaceError(
        distances.number("accuracy", 0),
        distances.number("completeness", 0),
        distances.number("seen_completeness", 0, default=None),
    )


def _color(found: Fields) -> ViewDependence | None:
    if "view_dependence" not in found:
        return None
    color = found.section("view_dependence")
    errors = color.array("prediction_psnr", (-1,)).tolist()
    return ViewDependence(
        color.whole("degree", 0, MAX_DEGREE), tuple(errors), color.whole("points")
    )


def _depth_report(start: Fields) -> DepthReport | None:
    if "pixels" not in start:
        return None
    names = ("pixels", "voxels", "seconds")
    counts = {name: start.section(name, optional=True) for name in names}
    return DepthReport(
        voxel_size=start.number("voxel_size", default=0.0),
        pixels={name: counts["pixels"].whole(name) for name in counts["pixels"].values},
        voxels={name: counts["voxels"].whole(name) for name in counts["voxels"].values},
        seconds={name: counts["seconds"].number(name) for name in counts["seconds"].values},
    )
