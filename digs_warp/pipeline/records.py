"""What the folder of a reconstruction holds beside the Gaussians: records of the stages, scores, views.

There is one record for each stage: `Poses`, `Start`, `Training`, `Scores`, `Verdict`. Each lies under its
name in the results of run.json, by one writer and one reader: a field is a result. Its label names it in
`digs-warp info` and in the report. The file of scores is written last: with it the folder is complete.
"""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, MetricScale, read_capture
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.posed_frames import CAMERAS, PosedFrames
from digs_warp.init.scale import ScaleEstimate
from digs_warp.init.start import Subject
from digs_warp.measure.scores import Scores
from digs_warp.poses.from_images.quality import SfmQuality
from digs_warp.poses.outcome import PoseRefinement, Tracking
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json
from digs_warp.record.layout import CAPTURE, EVALUATION, RUN_RECORD, places_of
from digs_warp.record.manifest import Manifest
from digs_warp.record.results import Figure
from digs_warp.record.run_log import RunRecord
from digs_warp.record.typed import NOT_STORED, from_json, to_json

logger = logging.getLogger(__name__)

T = TypeVar("T")


RENDERS = "renders"


@dataclass(frozen=True, eq=False, kw_only=True)
class Poses:
    """The record of the poses: the frames as they are used, and where their poses come from.

    Attributes:
        frames: with metric cameras and masks; cameras.json has them. None: the recording is not known.
        subject: what is reconstructed; the frames of a scene have no masks.
        metric_scale: whether lengths are in metres, and how that is known; None where nothing says it.
        world_offset: what was taken off all places of the recording, see `digs_warp.data.about.About`.
        findings: what does not fit together in the recording; see `digs_warp.check`.
        errors: kinds of those of them that no good result can come of.
        sfm: quality of structure from motion, where images were matched.
        scale: between structure from motion and metres; None for given poses.
        tracking: how well poses found by color and depth fit together, where they were.
        refinement: whether the poses were refined, and why.
    """

    frames: Annotated[PosedFrames | None, NOT_STORED] = None
    subject: Annotated[Subject, Figure("subject")] = "object"
    metric_scale: Annotated[MetricScale | None, Figure("scale")] = None
    world_offset: Annotated[tuple[float, float, float] | None, Figure("offset of the world")] = None
    findings: Annotated[tuple[str, ...], Figure("findings")] = ()
    errors: tuple[str, ...] = ()
    sfm: Annotated[SfmQuality | None, Figure("structure from motion")] = None
    scale: Annotated[ScaleEstimate | None, Figure("scale of the matched images")] = None
    tracking: Annotated[Tracking | None, Figure("tracking")] = None
    refinement: Annotated[PoseRefinement | None, Figure("refined poses")] = None

    @property
    def posed(self) -> PosedFrames:
        """The frames, where the recording is known."""
        assert self.frames is not None
        return self.frames


@dataclass(frozen=True)
class OnObject:
    """What the recording shows of what is reconstructed; None: not known.

    Attributes:
        depth: share of its pixels that have depth, 0 to 1.
        span: how wide and high it is in the images [px], the root of its area.
        apart: median difference of its depth between neighboring views [m].
        off: median error of its depth where the truth is recorded [m].
        steps: median change of brightness between its thumbnail pixels [of 255].
    """

    depth: float | None = None
    span: float | None = None
    apart: float | None = None
    off: float | None = None
    steps: float | None = None


@dataclass(frozen=True)
class Verdict:
    """The record of what a result is worth.

    Attributes:
        good: whether nothing speaks against it.
        because: what was measured; of a poor result, what is poor.
        advice: what to do about it, the most useful first; empty if it is good.
        measured: on the object.
        words: all of it in a sentence.
    """

    good: bool = True
    because: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()
    measured: OnObject = OnObject()
    words: Annotated[str, Figure("verdict")] = ""


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


def find_capture(folder: Path, recorded: Path | None = None) -> Path | None:
    """Return the capture that a run left in or beside ``folder``, else the ``recorded`` one, else None."""
    noted = () if recorded is None else places_of(recorded, folder)
    beside = folder.absolute().parent / CAPTURE  # of "." the parent is "." itself
    candidates = (folder / CAPTURE, folder.parent / CAPTURE, beside, *noted)
    return next((path for path in candidates if (path / INDEX_NAME).is_file()), None)


def read_scores(path: Path) -> Scores:
    """Return the scores in a file.

    Raises:
        DigsError: it is broken.
    """
    content = read_json(path, "evaluation")
    try:
        return Scores.from_json(content)
    except DigsError as error:
        raise DigsError(
            f"evaluation '{path}': {error}; expected 'mean', and 'views' that each have a 'name'; "
            "reconstruct again"
        ) from error


def find_frames(
    folder: Path, capture: Capture | None, recorded: Path | None = None
) -> tuple[PosedFrames | None, Path | None]:
    """Return the frames as used, and where the capture is; one that nobody named may be broken."""
    if capture is not None:
        return _frames(folder, capture), capture.stored_in
    place = find_capture(folder, recorded)
    if place is None:
        return None, None
    try:
        return _frames(folder, read_capture(place)), place
    except DigsError as error:
        logger.warning("the views of '%s' are not known: %s", folder, error)
        return None, place


def _frames(folder: Path, capture: Capture) -> PosedFrames:
    if (folder / CAMERAS).is_file():
        return PosedFrames.load(capture, folder)
    return PosedFrames.as_recorded(capture)


def is_finished(folder: Path) -> bool:
    """Whether a folder holds a whole reconstruction: no file that was written is missing."""
    return (folder / EVALUATION).is_file() and Manifest.read(folder).is_complete()
