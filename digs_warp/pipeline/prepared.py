"""Everything that training starts from, as the front end leaves it in the folder of a reconstruction."""

from dataclasses import dataclass, replace
from pathlib import Path

from digs_warp.data.capture import Capture
from digs_warp.data.metric_scale import MetricScale
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.init.scale import ScaleEstimate
from digs_warp.init.start import Initialization, Subject
from digs_warp.pipeline.results import Results
from digs_warp.poses.from_images.quality import SfmQuality
from digs_warp.poses.refinement import PoseRefinement
from digs_warp.poses.tracking import Tracking
from digs_warp.record.layout import INITIAL_POINTS, RUN_RECORD
from digs_warp.record.run_log import RunLog, RunRecord


@dataclass(frozen=True, eq=False)
class Prepared:
    """Everything that training starts from.

    Attributes:
        frames: with metric cameras and masks.
        start: the points, and where they come from.
        sfm: quality of structure from motion, where images were matched.
        scale: of the estimated poses; None for given ones.
        doubts: what does not fit together in the capture; see `digs_warp.check`.
        subject: what is reconstructed; the frames of a scene have no masks.
        metric_scale: whether lengths are in metres, and how that is known; None where nothing says it.
        refinement: whether the poses were refined, and why.
        tracking: how well poses found by color and depth fit together, where they were.
    """

    frames: PosedFrames
    start: Initialization
    sfm: SfmQuality | None = None
    scale: ScaleEstimate | None = None
    doubts: tuple[str, ...] = ()
    subject: Subject = "object"
    metric_scale: MetricScale | None = None
    refinement: PoseRefinement | None = None
    tracking: Tracking | None = None

    @staticmethod
    def load(capture: Capture, folder: Path) -> "Prepared":
        """Read what `save` left in ``folder``.

        Raises:
            DigsError: a file is missing or broken.
        """
        record = RunRecord.find(folder)
        results = Results.read(record, folder / RUN_RECORD) if record else Results()
        start = results.start(PointCloud.load(folder / INITIAL_POINTS))
        frames = PosedFrames.load(capture, folder)
        return Prepared(
            frames,
            start,
            results.sfm,
            results.scale,
            results.doubts,
            results.subject,
            results.metric_scale,
            results.refinement,
            results.tracking,
        )

    def save(self, capture: Capture, folder: Path, log: RunLog) -> None:
        """Save everything to ``folder``; the points come last: they tell a resumed run that all is there."""
        results = Results.of_start(capture.stored_in, self.start, self.sfm, self.scale)
        results = replace(
            results,
            doubts=self.doubts,
            subject=self.subject,
            metric_scale=self.metric_scale,
            refinement=self.refinement,
            tracking=self.tracking,
        )
        log.results = results.to_json()
        log.save(folder / RUN_RECORD)
        self.frames.save(folder)
        self.start.points.save(folder / INITIAL_POINTS)
