"""The recordings that can be read, by the name of their form."""

from collections.abc import Callable
from pathlib import Path

from digs_warp.checks import CaptureError, require_folder
from digs_warp.interchange.recordings.bop import read_bop
from digs_warp.interchange.recordings.nerfstudio import read_nerfstudio
from digs_warp.interchange.recordings.record3d import read_record3d
from digs_warp.interchange.recordings.recording import Recording
from digs_warp.interchange.recordings.redwood import read_redwood
from digs_warp.interchange.recordings.scannet import read_scannet
from digs_warp.interchange.recordings.tum import read_tum
from digs_warp.interchange.recordings.zed import read_zed

READERS: dict[str, Callable[[Path], Recording]] = {
    "nerfstudio": read_nerfstudio,
    "tum": read_tum,
    "scannet": read_scannet,
    "record3d": read_record3d,
    "zed": read_zed,
    "redwood": read_redwood,
    "bop": read_bop,
}


def read_recording(folder: Path, form: str) -> Recording:
    """Read a recording of the form ``form``, one of `READERS`; pixels are read when it is written.

    Raises:
        DigsError: an unknown form, a missing folder, or files that are missing or broken.
    """
    if form not in READERS:
        raise CaptureError(f"recording format '{form}': expected one of {', '.join(READERS)}")
    require_folder(
        folder,
        "recording",
        "Name the folder with its images and depth maps; a film alone has no depth.",
    )
    return READERS[form](folder)
