"""The recording as a reconstruction used it: refined or estimated poses, its masks, and what it held out."""

from dataclasses import replace
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.layout import find_gaussians


def posed_capture(folder: Path) -> Capture:
    """Return the capture in ``folder``; if that holds a reconstruction, its capture with its frames.

    Frames that the reconstruction could not place are left out, and so are sparse points of the recording,
    which belong to the poses that it had.

    Raises:
        DigsError: neither is there, a file is broken, or the recording of a reconstruction is gone.
    """
    if not _is_reconstruction(folder):
        return read_capture(folder)
    result = Reconstruction.load(folder)
    if result.frames is None or result.capture is None:
        raise DigsError(
            f"reconstruction '{folder}': found no capture that it was made from; put one beside it, named "
            "'capture'"
        )
    capture = read_capture(result.capture)
    frames = tuple(frame for frame, _ in result.frames.by_time)
    about = replace(capture.about, poses_known=None)
    held_out = frozenset(frame.name for frame in result.frames.held_out)
    return replace(capture, frames=frames, about=about, points=None, held_out=held_out)


def _is_reconstruction(folder: Path) -> bool:
    if not folder.is_dir() or (folder / INDEX_NAME).is_file():
        return False
    try:
        find_gaussians(folder)
    except DigsError:
        return False
    return True
