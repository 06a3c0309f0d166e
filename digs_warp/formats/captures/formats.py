"""The formats that recordings are read from and captures are exported to, by name."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from digs_warp.checks import CaptureError, DigsError, require_folder
from digs_warp.data.capture import Capture
from digs_warp.formats.captures.bop import read_bop, write_bop
from digs_warp.formats.captures.colmap import write_colmap_binary, write_colmap_text
from digs_warp.formats.captures.colmap_import import read_colmap
from digs_warp.formats.captures.euroc import read_euroc
from digs_warp.formats.captures.kitti import write_kitti_stereo
from digs_warp.formats.captures.middlebury import write_middlebury
from digs_warp.formats.captures.nerfstudio import read_nerfstudio, write_nerfstudio
from digs_warp.formats.captures.realsense import read_bag
from digs_warp.formats.captures.recording import Recording
from digs_warp.formats.captures.redwood import read_redwood, write_redwood
from digs_warp.formats.captures.scanner_exports import read_record3d, read_scannet, read_zed
from digs_warp.formats.captures.sceneflow import write_sceneflow
from digs_warp.formats.captures.seven_scenes import read_seven_scenes
from digs_warp.formats.captures.tum import read_tum, write_tum
from digs_warp.formats.captures.video import read_film
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

# Those whose recording is one file with many frames; the folder is for the chosen frames.
FILE_READERS: dict[str, Callable[[Path, Path, "ImportOptions"], Recording]] = {
    "video": lambda file, scratch, options: read_film(
        file, scratch, options.frames or MOST_OF_A_FILM, options.fov_deg
    ),
    "realsense": lambda file, scratch, options: read_bag(
        file, scratch, options.frames or MOST_OF_A_FILM
    ),
}

# Frames that are taken of a film if nobody says how many.
MOST_OF_A_FILM = 120

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


@dataclass(frozen=True)
class ImportOptions:
    """What is taken of a recording.

    Attributes:
        frames: the most frames, evenly spread; None: all, of a film `MOST_OF_A_FILM`.
        fov_deg: horizontal field of view of images from which lens distortion is removed; None: the focal
            length stays. Of a film, the field of view of its camera.
    """

    frames: int | None = None
    fov_deg: float | None = None


@contextmanager
def opened_recording(
    source: Path, form: str, options: ImportOptions = ImportOptions()
) -> Iterator[Recording]:
    """Yield a recording of the format ``form``, one of `READERS` or `FILE_READERS`.

    Frames of a film are in a temporary folder, which the end of the block deletes.

    Raises:
        DigsError: as of `read_recording`, or a library that the format needs is missing.
    """
    if form in FILE_READERS:
        with TemporaryDirectory(prefix="digs-warp-") as scratch:
            yield FILE_READERS[form](source, Path(scratch), options)
        return
    recording = read_recording(source, form)
    if options.frames is not None:
        recording = recording.thinned(options.frames)
    if options.fov_deg is not None:
        recording = recording.with_field_of_view(options.fov_deg)
    yield recording


def read_recording(folder: Path, form: str) -> Recording:
    """Read a recording of the format ``form``, one of `READERS`; its pixels are read when it is converted.

    Raises:
        DigsError: an unknown format, a missing folder, or files that are missing or broken.
    """
    if form not in READERS:
        known = [*READERS, *FILE_READERS]
        raise CaptureError(f"recording format '{form}': unknown{did_you_mean(form, known)}")
    require_folder(
        folder,
        "recording",
        "Name the folder with its images and depth maps; for a film add --from video.",
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
