"""7-Scenes, and data sets in its layout (3DMatch, RIO10, BundleFusion): three files for each frame.

docs/recordings.md has the layout. 7-Scenes itself has no calibration: its images are those of a Kinect, not
registered to each other, and the poses are those of the depth camera. Images of 640 x 480 pixels get the
figures in common use for it. See https://www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes/.
"""

from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.images import MM_PER_METRE, image_size
from digs_warp.formats.captures.recording import (
    DEPTH_SUFFIXES,
    IMAGE_SUFFIXES,
    DepthCamera,
    NumberedFiles,
    Recording,
    expecting,
    known_pose,
    numbered_files,
    read_numbers,
)
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.record.files import read_text

CALIBRATION = "camera-intrinsics.txt"

# The page of the data set gives the first; the second is that of the Kinect's color camera.
KINECT_SIZE = (640, 480)
DEPTH_MATRIX = np.array([[585.0, 0, 320], [0, 585, 240], [0, 0, 1]])
COLOR_MATRIX = np.array([[525.0, 0, 320], [0, 525, 240], [0, 0, 1]])

# The color camera of a Kinect beside its depth camera [m]: the calibration that the Liris laboratory
# published, as evaluations on 7-Scenes use it.
COLOR_FROM_DEPTH = np.array(
    [
        [0.99996518012567637, 0.0026765126468950343, -0.0079041012313000904, -0.025558943178152542],
        [-0.00274093112813167, 0.99996302803027592, -0.0081504520778013286, 0.00010109636268061706],
        [0.0078819942130445332, 0.0081718328771890631, 0.99993554558014031, 0.0020318321729487039],
        [0.0, 0.0, 0.0, 1.0],
    ]
)


def read_seven_scenes(folder: Path) -> Recording:
    """Read one sequence, such as chess/seq-01."""
    images = numbered_files(folder, "frame-", IMAGE_SUFFIXES, ".color")
    if not images:
        sequences = sorted(path.name for path in folder.glob("seq-*") if path.is_dir())
        hint = (
            f"name one of its sequences: {', '.join(sequences)}"
            if sequences
            else "is this the right --from?"
        )
        raise CaptureError(
            f"recording '{folder}': no images frame-NUMBER.color.png or .jpg; {hint}"
        )
    files = NumberedFiles(
        folder, images, numbered_files(folder, "frame-", DEPTH_SUFFIXES, ".depth")
    )
    depth_size = image_size(next(iter(files.depths.values()))) if files.depths else files.image_size
    color, depth, units = _cameras(folder, files.image_size, depth_size)
    poses = {
        number: _color_pose(path, depth)
        for number, path in numbered_files(folder, "frame-", (".txt",), ".pose").items()
    }
    return files.recording(
        color,
        poses,
        depth_camera=depth if files.depths else None,
        depth_units_per_metre=dict.fromkeys(images, units),
    )


def _cameras(
    folder: Path, size: tuple[int, int], depth_size: tuple[int, int]
) -> tuple[Intrinsics, DepthCamera | None, float]:
    """Return the color camera, the depth camera where it is another, and depth units per metre.

    They are those of a file, or those of the Kinect of 7-Scenes.
    """
    for place in (folder, folder.parent):
        if (path := place / CALIBRATION).is_file():
            matrix = read_numbers(path, (3, 3), "calibration")
            return Intrinsics.from_matrix(matrix, *size, first_center=0), None, MM_PER_METRE
        for path in (place / "info.txt", place / "_info.txt"):
            if path.is_file():
                return _cameras_of_info(path, size, depth_size)
    if size != KINECT_SIZE or depth_size != KINECT_SIZE:
        raise CaptureError(
            f"recording '{folder}': images of {size[0]}x{size[1]} pixels and no {CALIBRATION}; write "
            "fx 0 cx, 0 fy cy, 0 0 1 into that file (first pixel center at 0, 0)"
        )
    color = Intrinsics.from_matrix(COLOR_MATRIX, *size, first_center=0)
    return color, kinect_depth_camera(*size), MM_PER_METRE


def _cameras_of_info(
    path: Path, size: tuple[int, int], depth_size: tuple[int, int]
) -> tuple[Intrinsics, DepthCamera, float]:
    """Read lines "name = values"; color and depth look from the same place."""
    lines = (line.partition("=") for line in read_text(path, "calibration").splitlines())
    values = {name.strip(): value.split() for name, _, value in lines}
    expected = (
        "4 x 4 numbers for m_calibrationColorIntrinsic and ...DepthIntrinsic, m_depthShift > 0"
    )
    with expecting(f"'{path}'", expected):
        color, depth = (
            np.array(values[f"m_calibration{kind}Intrinsic"], dtype=np.float64).reshape(4, 4)
            for kind in ("Color", "Depth")
        )
        units = float(values.get("m_depthShift", [MM_PER_METRE])[0])
        if not units > 0:
            raise ValueError(f"m_depthShift is {units}")
    camera = DepthCamera(Intrinsics.from_matrix(depth, *depth_size, first_center=0))
    return Intrinsics.from_matrix(color, *size, first_center=0), camera, units


def kinect_depth_camera(width: int, height: int) -> DepthCamera:
    """Return the depth camera of the first Kinect for images of a size, beside its color camera."""
    camera = Intrinsics.from_matrix(DEPTH_MATRIX, *KINECT_SIZE, first_center=0)
    return DepthCamera(camera.resized(width, height), COLOR_FROM_DEPTH)


def _color_pose(path: Path, depth: DepthCamera | None) -> np.ndarray | None:
    """Return world from color camera; None where tracking failed."""
    pose = known_pose(read_numbers(path, (4, 4), "pose"))
    if pose is None or depth is None or depth.color_from_depth is None:
        return pose
    return pose @ invert_rigid(depth.color_from_depth)
