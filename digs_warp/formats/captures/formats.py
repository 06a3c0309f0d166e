"""The formats that recordings are read from and captures are exported to, by name.

One more format is a file in this folder, and its name and functions here.
"""

import importlib
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from digs_warp.checks import CaptureError, DigsError, require_folder
from digs_warp.words import did_you_mean

if TYPE_CHECKING:
    from digs_warp.data.capture import Capture
    from digs_warp.formats.captures.recording import Recording

logger = logging.getLogger(__name__)

# The module and function that reads a folder as a `Recording`.
READERS: dict[str, str] = {
    "nerfstudio": "nerfstudio.read_nerfstudio",
    "tum": "tum.read_tum",
    "scannet": "scans.read_scannet",
    "record3d": "scans.read_record3d",
    "zed": "scans.read_zed",
    "redwood": "redwood.read_redwood",
    "bop": "bop.read_bop",
    "colmap": "colmap_import.read_colmap",
    "euroc": "euroc.read_euroc",
    "7scenes": "seven_scenes.read_seven_scenes",
    "polycam": "scans.read_polycam",
}
# The same of those whose frames are in a film, a bag or an archive.
FILE_READERS: dict[str, str] = {
    "video": "video.read_film",
    "record3d": "scans.read_r3d",
    "stray": "scans.read_stray",
    "realsense": "ros.read_ros",
    "ros": "ros.read_ros",
}
# What ``--from`` names.
RECORDINGS = tuple(dict.fromkeys([*READERS, *FILE_READERS]))

# Frames that are taken of a film if nobody says how many.
MOST_OF_A_FILM = 120

# The module and function that writes a capture into a folder.
EXPORTERS: dict[str, str] = {
    "colmap": "colmap.write_colmap_binary",
    "colmap-text": "colmap.write_colmap_text",
    "nerfstudio": "nerfstudio.write_nerfstudio",
    "tum": "tum.write_tum",
    "bop": "bop.write_bop",
    "redwood": "redwood.write_redwood",
    "hdf5": "training_sets.write_hdf5",
    "webdataset": "training_sets.write_webdataset",
    "kitti-stereo": "stereo.write_kitti_stereo",
    "sceneflow": "stereo.write_sceneflow",
    "middlebury": "stereo.write_middlebury",
}

# The choices of the command line.
if TYPE_CHECKING:
    RecordingFormat: TypeAlias = str
    CaptureFormat: TypeAlias = str
else:
    RecordingFormat = Literal[*RECORDINGS]
    CaptureFormat = Literal[*EXPORTERS]


def _function(place: str) -> Callable[..., Any]:
    """Return a function of this room, ``module.name``; imported now, for the command line reads this file."""
    module, _, name = place.partition(".")
    return getattr(importlib.import_module(f"digs_warp.formats.captures.{module}"), name)


@contextmanager
def opened_recording(
    source: Path, form: str, frames: int | None = None, fov_deg: float | None = None
) -> "Iterator[Recording]":
    """Yield a recording of the format ``form``, one of `READERS` or `FILE_READERS`.

    Frames of a film or an archive are in a temporary folder, which the end of the block deletes.

    Args:
        source: its folder or file.
        form: the format.
        frames: the most to take, evenly spread; None: all, of a film `MOST_OF_A_FILM`.
        fov_deg: horizontal field of view of images from which lens distortion is removed; None: the focal
            length stays. Of a film, the field of view of its camera.

    Raises:
        DigsError: as of `read_recording`, or a library that the format needs is missing.
    """
    if form in FILE_READERS and not (form in READERS and source.is_dir()):
        camera = (fov_deg,) if form == "video" else ()
        with TemporaryDirectory(prefix="digs-warp-") as scratch:
            count = frames or MOST_OF_A_FILM
            yield _function(FILE_READERS[form])(source, Path(scratch), count, *camera)
        return
    recording = read_recording(source, form)
    if frames is not None:
        recording = recording.thinned(frames)
    if fov_deg is not None:
        recording = recording.with_field_of_view(fov_deg)
    yield recording


def read_recording(folder: Path, form: str) -> "Recording":
    """Read a recording of the format ``form``, one of `READERS`; its pixels are read when it is converted.

    Raises:
        DigsError: an unknown format, a missing folder, or files that are missing or broken.
    """
    if form not in READERS:
        raise CaptureError(f"recording format '{form}': unknown{did_you_mean(form, RECORDINGS)}")
    require_folder(
        folder,
        "recording",
        "Name the folder with its images and depth maps; for a film add --from video.",
    )
    try:
        return _function(READERS[form])(folder).completed(form)
    except DigsError as error:
        if str(folder) in str(error):
            raise
        raise CaptureError(f"recording '{folder}': {error}") from error


def export_capture(capture: "Capture", form: str, folder: Path) -> None:
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
    if capture.about.world_offset:
        logger.warning(
            "%s: places in the export are less by the offset of the recording, %s m",
            *(capture, capture.about.world_offset),
        )
    _function(EXPORTERS[form])(capture, Path(folder))
