"""Real recordings of the sample data, laid out as the package's own readers expect them.

Nothing is copied into the project. What their licenses say about pictures is beside each of them.
"""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.images import encode_jpeg, read_image
from digs_warp.formats.captures.formats import read_recording
from digs_warp.formats.captures.to_capture import write_capture
from digs_warp.record.files import read_json, read_text, write_atomically
from digs_warp.study.scenes import SEE_SAMPLE_DATA
from digs_warp.words import did_you_mean

# Photographs of 2.5 megapixels would take minutes for what a third of the width tells, too.
DOOR_REDUCTION = 3


def as_it_is(source: Path, folder: Path) -> Path:
    """Return ``source``: a reader takes the folder itself."""
    return source


@dataclass(frozen=True)
class RealRecording:
    """A recording that other people made.

    Attributes:
        name: of its folder, below ``rgbd`` of the sample data.
        form: the reader, as `digs-warp convert --from` names it.
        what: was recorded, with which camera.
        credit: who made it, and under which license.
        has_poses: whether the poses were recorded.
        pictures_allowed: whether the license clearly lets pictures of it be shown.
        arrange: takes the source and an empty folder, and returns the folder for the reader.
    """

    name: str
    form: str
    what: str = ""
    credit: str = ""
    has_poses: bool = True
    pictures_allowed: bool = False
    arrange: Callable[[Path, Path], Path] = as_it_is


def room_as_seven_scenes(source: Path, folder: Path) -> Path:
    """Name the files of DeepVideoMVS's HoloLens sample as 7-Scenes does."""
    poses = np.loadtxt(source / "poses.txt").reshape(-1, 16)
    for image, pose in zip(sorted((source / "images").iterdir()), poses, strict=True):
        name = f"frame-{int(image.stem):06d}"
        _link(folder / f"{name}.color.png", image)
        _link(folder / f"{name}.depth.png", source / "depth" / image.name)
        _write(folder / f"{name}.pose.txt", " ".join(map(repr, pose.tolist())))
    _write(folder / "camera-intrinsics.txt", read_text(source / "K.txt", "calibration"))
    return folder


def cabinet_as_tum(source: Path, folder: Path) -> Path:
    """Write the lists of a TUM RGB-D sequence beside its images."""
    lines = read_text(source / "truth_cam_poses.txt", "poses").splitlines()
    times = [line.split()[0] for line in lines if line.strip()]
    for name in ("rgb", "depth"):
        _link(folder / name, source / name)
        files = sorted((source / name).iterdir())
        rows = [f"{time} {name}/{file.name}" for time, file in zip(times, files, strict=True)]
        _write(folder / f"{name}.txt", "\n".join(rows))
    _write(folder / "groundtruth.txt", "\n".join(lines))
    camera = read_json(source / "intrinsics.json", "calibration")
    figures = [str(camera[key]) for key in ("fx", "fy", "cx", "cy")]
    _write(folder / "calibration.txt", " ".join(figures))
    return folder


def smaller_door(source: Path, folder: Path) -> Path:
    """Reduce the photographs of a COLMAP workspace, and the camera of its model with them."""
    for path in sorted((source / "images").iterdir()):
        pixels = _reduced(read_image(path)[..., :3])
        write_atomically(folder / "images" / path.name, encode_jpeg(pixels, 95))
    model = source / "colmap_ground_truth"
    for name in ("images.txt", "points3D.txt"):
        _link(folder / "sparse" / name, model / name)
    text = read_text(model / "cameras.txt", "cameras of a model")
    number, kind, width, height, *lens = text.splitlines()[-1].split()
    sizes = [str(int(size) // DOOR_REDUCTION) for size in (width, height)]
    *places, distortion = map(float, lens)  # SIMPLE_RADIAL: f cx cy k
    scaled = [str(place / DOOR_REDUCTION) for place in places]
    line = " ".join([number, kind, *sizes, *scaled, str(distortion)])
    _write(folder / "sparse" / "cameras.txt", line)
    return folder


def _reduced(pixels: np.ndarray) -> np.ndarray:
    height, width = (size // DOOR_REDUCTION for size in pixels.shape[:2])
    blocks = pixels[: height * DOOR_REDUCTION, : width * DOOR_REDUCTION].reshape(
        height, DOOR_REDUCTION, width, DOOR_REDUCTION, 3
    )
    return np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)


def _link(path: Path, target: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to(target.resolve())


def _write(path: Path, text: str) -> None:
    write_atomically(path, f"{text}\n".encode())


RECORDINGS = (
    RealRecording(
        "hololens_room_sequence",
        "7scenes",
        "a corner of a room, 24 frames of 540 x 360, worn on a head (HoloLens, time of flight)",
        "Arda Duzceker et al., DeepVideoMVS; the repository is under the MIT License, which says nothing "
        "of the recording itself",
        arrange=room_as_seven_scenes,
    ),
    RealRecording(
        "tum_cabinet_orbit",
        "tum",
        "once around a steel cabinet without texture, 29 frames of 640 x 480, held in a hand (Xtion); "
        "poses by motion capture",
        'Sturm, Engelhard, Endres, Burgard and Cremers, "A Benchmark for the Evaluation of RGB-D SLAM '
        'Systems", IROS 2012, sequence freiburg3_cabinet, '
        "[CC BY 4.0](https://creativecommons.org/licenses/by/4.0/); every second of the 58 frames that "
        "Shichao Yang picked",
        pictures_allowed=True,
        arrange=cabinet_as_tum,
    ),
    RealRecording(
        "lund_door_photos",
        "colmap",
        "a carved church door, 12 photographs reduced to 432 x 645, without depth; poses and points by "
        "COLMAP, in its own unit",
        "Carl Olsson, Lund University, model by the authors of GTSFM; no license of the photographs is known",
        arrange=smaller_door,
    ),
    RealRecording(
        "euroc_static_stereo",
        "euroc",
        "8 gray stereo pairs of 752 x 480, five of them at rest (VI-Sensor), without depth and poses",
        'Burri et al., "The EuRoC micro aerial vehicle datasets", IJRR 2016; research use',
        has_poses=False,
    ),
)


def find_recordings(data: Path, names: Sequence[str] = ()) -> list[RealRecording]:
    """Return the recordings of those names; without names all that the sample data has.

    Args:
        data: folder of the sample data.
        names: of `RECORDINGS`.

    Raises:
        DigsError: an unknown name, one that is not there, or none at all.
    """
    known = {recording.name: recording for recording in RECORDINGS}
    for name in names:
        if name not in known:
            raise DigsError(f"recording '{name}': unknown{did_you_mean(name, known)}")
    place = data / "rgbd"
    there = [name for name in names or known if (place / name).is_dir()]
    if not there or (names and len(there) < len(names)):
        missing = " and ".join(name for name in names or known if name not in there)
        raise DigsError(f"real recordings: '{place}' has no {missing}; {SEE_SAMPLE_DATA}")
    return [known[name] for name in there]


def convert(
    recording: RealRecording, source: Path, folder: Path, frames: int | None = None
) -> Capture:
    """Write a recording as a capture folder.

    Args:
        recording: what it is.
        source: its folder.
        folder: of the capture; files that its reader needs lie beside it meanwhile.
        frames: how many, evenly spread over the recording; None: all.

    Raises:
        DigsError, OSError, ValueError: files are missing, or do not belong together.
    """
    arranged = folder.with_name(f"{folder.name}-source")
    shutil.rmtree(arranged, ignore_errors=True)
    arranged.mkdir(parents=True)
    try:
        read = read_recording(recording.arrange(source, arranged), recording.form)
        read = read if frames is None else read.thinned(frames)
        return write_capture(read, recording.form, folder)
    finally:
        shutil.rmtree(arranged)
