"""One record for each stage of a reconstruction: `Poses`, `Start`, `Training`, `Scores`.

Each lies under its name in the results of run.json, by one writer and one reader: a field is a result. Its
label names it in `digs-warp info` and in the report.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from digs_warp.data.metric_scale import MetricScale
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.init.scale import ScaleEstimate
from digs_warp.init.start import Subject
from digs_warp.poses.from_images.quality import SfmQuality
from digs_warp.poses.outcome import PoseRefinement, Tracking
from digs_warp.record.fields import Fields
from digs_warp.record.layout import RUN_RECORD
from digs_warp.record.results import Figure
from digs_warp.record.run_log import RunRecord
from digs_warp.record.typed import NOT_STORED, from_json, to_json

T = TypeVar("T")


@dataclass(frozen=True, eq=False, kw_only=True)
class Poses:
    """The record of the poses: the frames as they are used, and where their poses come from.

    Attributes:
        frames: with metric cameras and masks; cameras.json has them. None: the recording is not known.
        subject: what is reconstructed; the frames of a scene have no masks.
        metric_scale: whether lengths are in metres, and how that is known; None where nothing says it.
        findings: what does not fit together in the recording; see `digs_warp.check`.
        sfm: quality of structure from motion, where images were matched.
        scale: between structure from motion and metres; None for given poses.
        tracking: how well poses found by color and depth fit together, where they were.
        refinement: whether the poses were refined, and why.
    """

    frames: Annotated[PosedFrames | None, NOT_STORED] = None
    subject: Annotated[Subject, Figure("subject")] = "object"
    metric_scale: Annotated[MetricScale | None, Figure("scale")] = None
    findings: Annotated[tuple[str, ...], Figure("findings")] = ()
    sfm: Annotated[SfmQuality | None, Figure("structure from motion")] = None
    scale: Annotated[ScaleEstimate | None, Figure("scale of the matched images")] = None
    tracking: Annotated[Tracking | None, Figure("tracking")] = None
    refinement: Annotated[PoseRefinement | None, Figure("refined poses")] = None

    @property
    def posed(self) -> PosedFrames:
        """The frames, where the recording is known."""
        assert self.frames is not None
        return self.frames


def store(capture: Path | None, **stages: Any) -> dict[str, Any]:
    """Return the results of run.json: the folder of the recording, and each stage's record by its name."""
    results = {"capture": str(capture)} if capture else {}
    return results | {name: to_json(record) for name, record in stages.items() if record}


def stored(kind: type[T], run: RunRecord | None, folder: Path, **known: Any) -> T:
    """Return the record of a stage as the run.json of ``folder`` holds it, with what other files ``known``.

    Raises:
        DigsError: an entry has another form; the message names it.
    """
    found = _results(run, folder).section(kind.__name__.lower(), optional=True)
    return from_json(kind, found.values, found.where, remedy=found.remedy, **known)


def stored_capture(run: RunRecord | None, folder: Path) -> Path | None:
    """Return the folder of the recording as run.json notes it; None: it does not."""
    capture = _results(run, folder).text("capture", None)
    return Path(capture) if capture else None


def _results(run: RunRecord | None, folder: Path) -> Fields:
    where = f"run record '{folder / RUN_RECORD}', results"
    return Fields(run.results if run else {}, where, remedy="reconstruct again")
