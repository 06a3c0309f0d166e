"""The formats that recordings are read from and captures are exported to, by name."""

from collections.abc import Callable
from pathlib import Path

from digs_warp.checks import CaptureError, DigsError, require_folder
from digs_warp.data.capture import Capture
from digs_warp.interchange.captures.bop import read_bop, write_bop
from digs_warp.interchange.captures.colmap import write_colmap_binary, write_colmap_text
from digs_warp.interchange.captures.colmap_import import read_colmap
from digs_warp.interchange.captures.euroc import read_euroc
from digs_warp.interchange.captures.kitti import write_kitti_stereo
from digs_warp.interchange.captures.middlebury import write_middlebury
from digs_warp.interchange.captures.nerfstudio import read_nerfstudio
from digs_warp.interchange.captures.nerfstudio_export import write_nerfstudio
from digs_warp.interchange.captures.record3d import read_record3d
from digs_warp.interchange.captures.recording import Recording
from digs_warp.interchange.captures.redwood import read_redwood, write_redwood
from digs_warp.interchange.captures.scannet import read_scannet
from digs_warp.interchange.captures.sceneflow import write_sceneflow
from digs_warp.interchange.captures.seven_scenes import read_seven_scenes
from digs_warp.interchange.captures.tum import read_tum, write_tum
from digs_warp.interchange.captures.zed import read_zed
from digs_warp.words import did_you_mean

READERS: dict[str, Callable[[Path], Recording]] = {
    "nerfstudio": read_nerfstudio,
    "tum": read_tum,
    "scannet": read_scannet,
    "record3d": read_record3d,
    "zed": read_zed,
    "redwood": read_redwood,
    "bop": read_bop,
    "colmap": read_colmap,
    "7scenes": read_seven_scenes,
    "euroc": read_euroc,
}

EXPORTERS: dict[str, Callable[[Capture, Path], None]] = {
    "colmap": write_colmap_binary,
    "colmap-text": write_colmap_text,
    "nerfstudio": write_nerfstudio,
    "tum": write_tum,
    "bop": write_bop,
    "redwood": write_redwood,
    "kitti-stereo": write_kitti_stereo,
    "sceneflow": write_sceneflow,
    "middlebury": write_middlebury,
}


def read_recording(folder: Path, form: str) -> Recording:
    """Read a recording of the format ``form``, one of `READERS`; its pixels are read when it is converted.

    Raises:
        DigsError: an unknown format, a missing folder, or files that are missing or broken.
    """
    if form not in READERS:
        raise CaptureError(f"recording format '{form}': unknown{did_you_mean(form, READERS)}")
    require_folder(
        folder,
        "recording",
        "Name the folder with its images and depth maps; a film alone has no depth.",
    )
    return READERS[form](folder)


def export_capture(capture: Capture, form: str, folder: Path) -> None:
    """Write ``capture`` below ``folder`` in the format ``form``, one of `EXPORTERS`.

    Raises:
        DigsError: an unknown format, or a capture that lacks what the format needs, such as poses.
    """
    if form not in EXPORTERS:
        raise DigsError(f"export format '{form}': unknown{did_you_mean(form, EXPORTERS)}")
    if not capture.knows_poses:
        raise CaptureError(
            f"{capture}: the recording has no camera poses, and every export has them; give the images "
            "themselves to a program that estimates poses"
        )
    EXPORTERS[form](capture, Path(folder))
