"""The result of a reconstruction, in memory and in the folder of docs/reconstruction-format.md.

No other code reads or names the files of that folder that describe a result, but `stored_views` beside it.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.metric_scale import MetricScale
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.geometry.camera import Camera
from digs_warp.init.scale import ScaleEstimate
from digs_warp.init.start import Initialization, Subject
from digs_warp.init.view_dependence import ViewDependence
from digs_warp.measure.scores import Scores
from digs_warp.pipeline.results import Results
from digs_warp.pipeline.stored_views import (
    RENDERS,
    find_frames,
    read_render,
    read_scores,
    write_scores,
)
from digs_warp.poses.from_images.quality import SfmQuality
from digs_warp.poses.refinement import PoseRefinement
from digs_warp.poses.tracking import Tracking
from digs_warp.record.fields import Fields
from digs_warp.record.files import copy_folder
from digs_warp.record.layout import (
    COURSE,
    EVALUATION,
    GAUSSIANS,
    INITIAL_POINTS,
    RUN_RECORD,
    TRAINING,
    find_gaussians,
)
from digs_warp.record.run_log import RunRecord
from digs_warp.surface.error import SurfaceError
from digs_warp.train.course import CourseRow, read_course, write_course
from digs_warp.train.shutter import ShutterPlan
from digs_warp.train.snapshots import load_snapshots

if TYPE_CHECKING:
    from digs_warp.splat.render import RenderOutput

MASKS = "masks"


@dataclass(frozen=True, eq=False, kw_only=True)
class Reconstruction:
    """Gaussians, and what is known of how they were made.

    A finished reconstruction has everything; for Gaussians from elsewhere only the Gaussians are known.

    Attributes:
        gaussians: the result, in metres unless ``metric_scale`` says otherwise.
        frames: training and held-out views with the cameras and masks that were used, where these were not
            stored those of the capture; None where the capture is not known.
        start: the points that the training started from, and where they come from.
        scale: between structure from motion and metres; None for given poses.
        sfm: quality of structure from motion; None where no images were matched.
        scores: how well the held-out views match.
        course: loss and quality along the training, a row every few iterations.
        stopped_by: what ended the training: "iterations", "target psnr" or "time budget".
        exposure_stops: how much exposure and white balance vary between the photographs [stops]; 0 where they
            are known to be constant, None if that was not fitted.
        tone_lift: how much contrast and black level vary, as lifts of values [sRGB, 0 to 1]; None like it.
        run: settings, versions and machine, and the seconds of each stage.
        folder: where it is stored.
        capture: folder of the recording; None if it is not known, or only in memory.
        doubts: what does not fit together in the recording; empty for a good one.
        subject: what was reconstructed, the object in the masks or the whole scene.
        metric_scale: whether lengths are in metres, and how that is known; None where nothing says it.
        surface: how far the surface is from the true one; None where that is not known.
        refinement: whether the poses were refined, and why; None where it is not known.
        tracking: how well poses found by color and depth fit together, where they were.
        shutter: whether the training drew the rolling shutter, and why; None where it is not known.
        color: the degree of the color that the photographs called for; None where the settings said which.
    """

    gaussians: Gaussians
    frames: PosedFrames | None = None
    start: Initialization | None = None
    scale: ScaleEstimate | None = None
    sfm: SfmQuality | None = None
    scores: Scores = field(default_factory=Scores)
    course: tuple[CourseRow, ...] = ()
    stopped_by: str | None = None
    exposure_stops: float | None = None
    tone_lift: float | None = None
    run: RunRecord = field(default_factory=lambda: RunRecord("", {}, {}))
    folder: Path | None = None
    capture: Path | None = None
    doubts: tuple[str, ...] = ()
    subject: Subject = "object"
    metric_scale: MetricScale | None = None
    surface: SurfaceError | None = None
    refinement: PoseRefinement | None = None
    tracking: Tracking | None = None
    shutter: ShutterPlan | None = None
    color: ViewDependence | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """The settings as JSON values; empty where they are not known."""
        return self.run.settings

    @property
    def seconds(self) -> dict[str, float]:
        """Wall-clock time of each stage [s]."""
        return self.run.seconds

    @property
    def strategy(self) -> str | None:
        """How the initial points were made, such as "highdepth"; None where it is not known."""
        return self._setting("init", "strategy")

    @property
    def masks(self) -> str | None:
        """Where the masks came from: "capture", or how they were made; None where it is not known."""
        return self._setting("segment", "masks")

    @property
    def instance(self) -> int | None:
        """The number of the one object that was reconstructed, of several; None: all of them."""
        segment = Fields(self.settings, "settings").section("segment", optional=True)
        return segment.whole("instance", default=None)

    @property
    def adherence(self) -> float | None:
        """Median distance of the surface to the measured depth [m]; None where none was measured."""
        measured = [row.adherence for row in self.course if row.adherence is not None]
        return measured[-1] if measured else None

    @property
    def quality(self) -> str:
        """How well the held-out views match, in a phrase that names what was compared."""
        return self.scores.words(has_object=self.subject == "object")

    @property
    def results(self) -> Results:
        """The counts and figures in run.json."""
        last = self.course[-1] if self.course else None
        return replace(
            Results.of_start(self.capture, self.start, self.sfm, self.scale),
            doubts=self.doubts,
            subject=self.subject,
            metric_scale=self.metric_scale,
            refinement=self.refinement,
            tracking=self.tracking,
            shutter=self.shutter,
            color=self.color,
            gaussians=len(self.gaussians),
            iterations=last.iteration if last else None,
            stopped_by=self.stopped_by,
            training_seconds=round(last.seconds, 3) if last else None,
            exposure_stops=self.exposure_stops,
            tone_lift=self.tone_lift,
            held_out=self.scores.mean if self.scores.views else None,
            adherence=self.adherence,
            surface=self.surface,
        )

    def render(self, camera: Camera, **settings: Any) -> "RenderOutput":
        """Return a view of the Gaussians; the settings are those of `digs_warp.splat.render.render`."""
        from digs_warp.splat.render import render

        return render(self.gaussians, camera, **settings)

    def save_usd(self, path: Path | str, capture: Capture | None = None) -> None:
        """Write a USD scene.

        Args:
            path: the file; its suffix decides: .usdz (package), .usdc (binary), .usda (text).
            capture: the recording: its cameras and the initial points go into the scene (.usdz only).

        Raises:
            DigsError: another suffix, or the scene cannot be written.
        """
        from digs_warp.pipeline.usd_scene import write_capture_package, write_scene

        if capture is None:
            write_scene(self, Path(path))
        else:
            write_capture_package(capture, [self], Path(path))

    def in_memory(self) -> "Reconstruction":
        """Return the reconstruction without its folder; masks that were made for it are loaded.

        Renders of held-out views and training snapshots are not included.
        """
        frames = self.frames
        if frames and self.folder:
            frames = frames.with_masks_loaded(self.folder)
        return replace(self, frames=frames, folder=None)

    def load_render(self, name: str, shape: tuple[int, ...]) -> np.ndarray:
        """Return a held-out view as the Gaussians show it on white, sRGB, uint8.

        Args:
            name: of the frame.
            shape: of its photograph, (height, width, 3).

        Raises:
            DigsError: it was not stored, or has another size.
        """
        return read_render(self._stored(), name, shape)

    def load_snapshots(self) -> tuple[tuple[int, Gaussians], ...]:
        """Return (iteration, Gaussians) of the training, ascending; empty where none were kept.

        Raises:
            DigsError: a file is broken.
        """
        return load_snapshots(self.folder) if self.folder else ()

    def save(self, folder: Path) -> "Reconstruction":
        """Write a folder that `load` reads; return the reconstruction with it as its folder.

        Renders, snapshots and masks of the folder that it was loaded from are copied.
        """
        folder = Path(folder)
        frames = self.frames
        if self.folder is not None and self.folder.resolve() != folder.resolve():
            for name in (RENDERS, COURSE, MASKS):
                if (self.folder / name).is_dir():
                    copy_folder(self.folder / name, folder / name)
            frames = frames.moved(self.folder, folder) if frames else None
        if frames:
            frames.save(folder)
        if self.start:
            self.start.points.save(folder / INITIAL_POINTS)
        write_course(folder / TRAINING, self.course)
        write_scores(folder, self.scores)
        run = replace(self.run, results=self.results.to_json())
        run.save(folder / RUN_RECORD)
        self.gaussians.save(folder / GAUSSIANS)
        return replace(self, folder=folder, frames=frames, run=run)

    @staticmethod
    def load(
        folder: Path, capture: Capture | None = None, partial: bool = False
    ) -> "Reconstruction":
        """Read the folder of a reconstruction, or of a whole run.

        Args:
            folder: of 'digs-warp reconstruct' or 'digs-warp run', or its gaussians.npz.
            capture: the recording; without it, the one that was reconstructed, if it is still there.
            partial: accept an unfinished folder if it has Gaussians; missing parts are None.

        Raises:
            DigsError: a file is missing or broken; the message names it.
        """
        if not Path(folder).exists():
            raise DigsError(f"reconstruction '{folder}': no such folder")
        folder = find_gaussians(Path(folder)).parent
        gaussians = Gaussians.load(folder / GAUSSIANS)

        def wanted(name: str) -> bool:
            return not partial or (folder / name).is_file()

        scores = read_scores(folder / EVALUATION) if wanted(EVALUATION) else Scores()
        course = read_course(folder / TRAINING) if wanted(TRAINING) else ()
        run = RunRecord.load(folder / RUN_RECORD) if not partial else RunRecord.find(folder)
        results = Results.read(run, folder / RUN_RECORD) if run else Results()
        points = folder / INITIAL_POINTS
        frames, place = find_frames(folder, capture, results.capture)
        return Reconstruction(
            gaussians=gaussians,
            frames=frames,
            start=results.start(PointCloud.load(points)) if points.is_file() else None,
            scale=results.scale,
            sfm=results.sfm,
            scores=scores,
            course=course,
            stopped_by=results.stopped_by,
            exposure_stops=results.exposure_stops,
            tone_lift=results.tone_lift,
            run=run or RunRecord("", {}, {}),
            folder=folder,
            capture=place,
            doubts=results.doubts,
            subject=results.subject,
            metric_scale=results.metric_scale,
            surface=results.surface,
            refinement=results.refinement,
            tracking=results.tracking,
            shutter=results.shutter,
            color=results.color,
        )

    @staticmethod
    def of_gaussians(
        gaussians: Gaussians, folder: Path, capture: Capture | None = None
    ) -> "Reconstruction":
        """Return Gaussians that another program wrote into ``folder``, with the views of a capture.

        Without ``capture``, it is the one that a run left in or beside the folder, if any.
        """
        frames, place = find_frames(folder, capture)
        return Reconstruction(gaussians=gaussians, frames=frames, capture=place)

    def _setting(self, group: str, name: str) -> str | None:
        return Fields(self.settings, "settings").section(group, optional=True).text(name, None)

    def _stored(self) -> Path:
        if self.folder is None:
            raise DigsError("reconstruction: it is only in memory; save it to a folder first")
        return self.folder
