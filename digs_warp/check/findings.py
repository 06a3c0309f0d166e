"""The table of findings: each with its measure, limit, message and remedy, and the commands that look for it.

One more check is a function in the file of its family, and a row here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from digs_warp.check import alignment, conventions, motion, outliers, recording
from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence

# Who looks: `info` at a few pairs, `run` also at all frames of short recordings, `check` at everything.
Asker = Literal["info", "run", "check"]
ASKERS: tuple[Asker, ...] = ("info", "run", "check")


@dataclass(frozen=True)
class Finding:
    """Something in a capture that does not fit together, or is worse than it could be.

    Attributes:
        kind: what it is about.
        what: what was measured and what it means, a sentence or two.
        remedy: what to do about it, a sentence or two.
        is_error: no good reconstruction can come of the capture as it is; in spite of a warning it can be
            used, though it will be worse.
    """

    kind: str
    what: str
    remedy: str
    is_error: bool

    def __str__(self) -> str:
        return f"{self.what} {self.remedy}"


@dataclass(frozen=True, kw_only=True)
class Check:
    """A row of the table.

    Attributes:
        kind: name of the finding.
        measure: what of the capture exceeds the limit, as values for the message; None: nothing.
        limit: from where on it is a finding.
        message: what it says, with places for the values and the limit.
        remedy: what to do about it.
        is_error: whether no good reconstruction can come of such a capture.
        asked_by: the first of `ASKERS` that asks; those after it do, too.
        unless: not asked where one of these kinds was found, which look the same; ``ERRORS``: any error.
    """

    kind: str
    measure: Callable[[Evidence, float], dict[str, Any] | None]
    limit: float
    message: str
    remedy: str
    is_error: bool = False
    asked_by: Asker = "info"
    unless: tuple[str, ...] = ()

    def look(self, evidence: Evidence) -> Finding | None:
        """Return the finding, if there is one."""
        found = self.measure(evidence, self.limit)
        if found is None:
            return None
        what = self.message.format(limit=self.limit, **found)
        return Finding(self.kind, what, self.remedy, self.is_error)


ERRORS = "errors"

EXPLAINED = (
    "Neighboring frames agree to {recorded:.0%}. They would agree to {then:.0%} if this was corrected: "
    "{cause}."
)
NOT_ALIGNED = (
    "The depth fits the images better if it is moved by {move}: depth and images do not have the same "
    "camera.{kinect}"
)
REGISTER = (
    "Export depth that is registered to the color image, or let 'digs-warp convert FOLDER --from FORMAT "
    "--out CAPTURE --register-depth found' move it."
)

# Remedies for wrong units and conventions.
EXPLANATIONS = {
    "depth unit": "Write depth and poses in metres, or 16-bit depth in millimetres (for --from tum in "
    "5000 per metre).",
    "scale": "Both are in metres. Poses without a metric scale: use --poses sfm.",
    "focal length": "Check fl_x and fl_y; they belong to images of the size w x h.",
    "pose convention": "Poses are world from camera, with OpenGL camera axes (x right, y up, z backward).",
    "depth along rays": "Divide it by the length of the ray (x, y, 1) of each pixel.",
    "time stamps": "Check the timestamps.",
}

CHECKS = (
    Check(
        kind="still camera",
        measure=recording.still_camera,
        limit=limits.STILL_SHARE,
        message="The camera stands still while something turns or moves before it: {still:.0%} of the "
        "surroundings look the same in all frames.",
        remedy="Of an object on a turntable, give masks (of the recording, or --masks): --poses auto then "
        "finds the poses from what lies inside them; so does a printed board that turns with it, --poses "
        "board:FILE. Without masks, move the camera around the object instead.",
        is_error=True,
    ),
    Check(
        kind="attached",
        measure=recording.moves_along,
        limit=0.0,
        message="{share:.1%} of the image looks the same in nearly all photographs while the camera moves: a "
        "gripper, a hood or an overlay that moves with it would be trained as scene.",
        remedy="'digs-warp check CAPTURE --write-ignore-mask mask.png' marks it; look at the mask, and leave "
        "it out: 'digs-warp reconstruct CAPTURE --ignore-mask mask.png'.",
        unless=("still camera",),
    ),
    Check(
        kind="camera",
        measure=recording.camera_of_others,
        limit=0.2,  # of the side
        message="The principal point is at {across:.0%} of the width and {down:.0%} of the height: "
        "this camera is that of images of about {size} pixels.",
        remedy="Scale fl_x, fl_y, cx and cy to the size of these images.",
        is_error=True,
    ),
    *(
        Check(
            kind=kind,
            measure=conventions.explained(kind),
            limit=limits.CONVINCING_AGREEMENT,
            message=EXPLAINED,
            remedy=remedy,
            is_error=True,
        )
        for kind, remedy in EXPLANATIONS.items()
    ),
    Check(
        kind="distance",
        measure=conventions.too_far,
        limit=0.1,  # as "order"
        message="Neighboring frames agree to {recorded:.0%}: {distance:.3g} m away, one pixel of disparity "
        "is {step:.0%} of the distance, and stereo sees no shape.",
        remedy="Come nearer, record more pixels, or use a camera whose eyes are farther apart.",
        unless=(ERRORS,),
    ),
    Check(
        kind="order",
        measure=conventions.no_agreement,
        limit=0.1,  # simulated sensors with errors of twice their strength reach 0.13
        message="Neighboring frames agree to {recorded:.0%} in the {overlap:.0%} of their points that both "
        "look at, and no wrong unit, focal length or convention explains it: images, depth and poses do not "
        "belong together.",
        remedy="Check the order of the frames and their timestamps.",
        is_error=True,
        unless=(ERRORS, "distance"),
    ),
    Check(
        kind="agreement",
        measure=conventions.no_agreement,
        limit=0.5,
        message="Neighboring frames agree to {recorded:.0%} only, expected {limit:.0%} or more: their "
        "depth is coarse or full of holes, or poses or focal length are a little wrong.",
        remedy="Compare with --poses auto. If it is the depth: come nearer, or use a camera with a "
        "projector.",
        asked_by="check",
        unless=(ERRORS, "distance"),
    ),
    Check(
        kind="depth unit",
        measure=conventions.depth_range,
        limit=conventions.FARTHEST,
        message="The median depth is {median:.3g} m, expected {nearest:g} to {farthest:g} m: it seems to "
        "be in another unit.",
        remedy="Write float images in metres, or 16-bit images in millimetres.",
        is_error=True,
        unless=(ERRORS,),
    ),
    Check(
        kind="masks empty",
        measure=alignment.masks_of_nothing,
        limit=0.01,  # of the image; a smaller share counts as well if it has 50 px
        message="The masks mark almost nothing: {pixels} pixels (median).",
        remedy="255, or any number but 0, marks the object. Look at them, or make them again: --masks "
        "depth.",
        is_error=True,
    ),
    Check(
        kind="points",
        measure=conventions.points_elsewhere,
        limit=0.5,  # a simulated object and its scene, a real door; margin 2
        message="The sparse points do not fit the photographs: {found}.",
        remedy="Move them as the poses were moved (nerfstudio: applied_transform), or leave them out.",
        is_error=True,
    ),
    Check(
        kind="masks inverted",
        measure=alignment.masks_inverted,
        limit=0.5,  # a majority
        message="{inverted} of {count} masks cover the border of the image and leave out what is nearest: "
        "they seem to be inverted.",
        remedy="255 marks the object, 0 everything else.",
        is_error=True,
    ),
    Check(
        kind="alignment",
        measure=alignment.depth_elsewhere,
        limit=0.0125,  # of the width; as recorded, 29 simulated objects measure up to 0.0102, a room 0.006
        message=NOT_ALIGNED,
        remedy=REGISTER,
        is_error=True,
    ),
    Check(
        kind="moving things",
        measure=motion.moving_things,
        limit=0.015,  # a plain boot 0.007, real recordings below 0.001
        message="{share:.1%} of the points of a frame are gone in its neighbor, which shows something else "
        "behind them: something moves.",
        remedy="Record again while nothing moves, or use --masks so that only the object counts. If "
        "nothing moved, the poses are those of other frames: check their order.",
        unless=(ERRORS, "distance"),
    ),
    Check(
        kind="outlier frames",
        measure=outliers.contradicting(outliers.links, "frame"),
        limit=0.5,  # of the median agreement
        message="{odd} of {count} contradict the depth of the frames before and after: {names}.",
        remedy="Their poses are broken, or their depth is of another moment: leave these frames out.",
        asked_by="run",
        unless=(ERRORS, "distance"),
    ),
    Check(
        kind="break",
        measure=outliers.breaks,
        limit=0.5,  # of the median agreement
        message="The depth before and after does not fit together between frames {places}.",
        remedy="Are these two recordings in one, or was tracking lost there? Reconstruct each part alone, "
        "or find the poses again with --poses rgbd.",
        is_error=True,
        asked_by="run",
        unless=(ERRORS, "distance"),
    ),
    Check(
        kind="pose jump",
        measure=outliers.pose_jumps,
        limit=0.3,  # an arc of 12 frames, a real room; margin 1.3
        message="The poses jump between frames {places}: what both photographs show says that the camera "
        "moved otherwise.",
        remedy="Was tracking lost there, or are these two recordings in one? Reconstruct each part alone, "
        "or find the poses again with --poses sfm.",
        asked_by="run",
        unless=(ERRORS,),
    ),
    Check(
        kind="repeats",
        measure=recording.repeats,
        limit=0.2,  # a few frames at rest do no harm
        message="{repeated} of {count} repeat the one before: the camera was at rest, or frames are there "
        "twice.",
        remedy="They add no view, and where they are held out the scores are too good. Record again with "
        "the camera moving, or take fewer frames: convert --frames.",
        asked_by="check",
    ),
    Check(
        kind="masks disagree",
        measure=outliers.contradicting(outliers.mask_links, "mask"),
        limit=0.75,  # of the usual overlap; masks cut in half or with a neighboring object have 0.5
        message="{odd} of {count} contradict those of the frames before and after: {names}.",
        remedy="Make these masks again (all of them: --masks depth), or leave these frames out.",
        asked_by="run",
        unless=(ERRORS, "distance"),
    ),
    Check(
        kind="few views",
        measure=recording.few_views,
        limit=6,  # the smallest good recordings have 12; 3 cannot be enough
        message="The recording has only {views}: most of it is seen once.",
        remedy="Record 30 to 60 frames, from all sides and two heights.",
        asked_by="check",
        unless=(ERRORS,),
    ),
    Check(
        kind="exposure",
        measure=recording.exposure_jumps,
        limit=0.42,  # stops; cameras that adapt reach 0.32
        message="The exposure changes by {stops:.1f} stops from frame to frame (median).",
        remedy="Keep --fit-exposure on, which is the default. Next time, lock exposure and white balance.",
        asked_by="check",
        unless=(ERRORS,),
    ),
)


def limit_of(kind: str) -> float:
    """Return the limit of the last row of a kind."""
    return next(check.limit for check in reversed(CHECKS) if check.kind == kind)
