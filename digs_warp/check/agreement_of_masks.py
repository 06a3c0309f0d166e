"""A finding about single masks that most other views contradict."""

from digs_warp.check.finding import Finding
from digs_warp.check.mask_votes import contradicted, mask_votes
from digs_warp.check.small_frames import small_depths
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.words import counted


def masks_that_disagree(capture: Capture) -> list[Finding]:
    """Return a finding that names the frames; nothing without poses, depth or masks.

    Raises:
        DigsError: a file that cannot be read.
    """
    numbers = [
        number
        for number, frame in enumerate(capture.frames)
        if frame.has(Layer.MASK) and frame.has(Layer.DEPTH)
    ]
    if not (capture.knows_poses and numbers):
        return []
    votes = mask_votes([*small_depths(capture.frames, numbers).values()])
    names = [capture.frames[numbers[odd]].name for odd in contradicted(votes)]
    if not names:
        return []
    what = (
        f"{counted(len(names), 'mask')} of {len(numbers)} contradict what most other views show: "
        f"{', '.join(names)}."
    )
    return [
        Finding(
            "masks disagree",
            what,
            "'reconstruct' mends them; the setting mask_agreement: off keeps them.",
        )
    ]
