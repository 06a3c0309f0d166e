"""What is wrong with some of the frames, or between some of them and the others."""

from digs_warp.check.changed import changed_scene
from digs_warp.check.finding import Finding
from digs_warp.check.odd_frames import odd_frames
from digs_warp.check.pose_jumps import pose_jumps
from digs_warp.check.still_camera import still_camera
from digs_warp.data.capture import Capture


def frame_doubts(capture: Capture) -> list[Finding]:
    """Return findings that name frames, and those about a scene that changed.

    Raises:
        DigsError: a file that cannot be read.
    """
    found = odd_frames(capture) + pose_jumps(capture)
    # Behind wrong poses a scene seems to change.
    return found if found else changed_scene(capture) + still_camera(capture)
