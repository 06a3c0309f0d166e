"""COLMAP: a sparse model with known poses, binary or as text, beside the images.

Pixel centers are at +0.5, as here; poses are camera from world, quaternions wxyz. The points are a start for
splat trainers, not matches: they come from the sensed depth, and have no tracks.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import to_uint8
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.frames import (
    copy_image,
    for_each_frame,
    start_points,
    write_mask,
)
from digs_warp.poses.from_images.colmap import quiet_pycolmap
from digs_warp.poses.from_images.workspace import write_model
from digs_warp.record.disk import out_of_space
from digs_warp.record.files import copy_file

SPARSE = "sparse/0"


def write_colmap_binary(capture: Capture, folder: Path) -> None:
    """Write the capture as a COLMAP model in binary files, which nearly all splat trainers want."""
    write_model(_images_and_model(capture, folder), folder / SPARSE)


def write_colmap_text(capture: Capture, folder: Path) -> None:
    """Write the capture as a COLMAP model in text files."""
    model = _images_and_model(capture, folder)
    with TemporaryDirectory(prefix="digs-warp-") as place:
        model.write_text(place)
        again = quiet_pycolmap().Reconstruction()
        again.read_text(place)
        if again.num_points3D() != model.num_points3D():
            raise out_of_space(Path(place), "COLMAP's files are not complete")
        for path in Path(place).iterdir():
            copy_file(path, folder / SPARSE / path.name)


def _images_and_model(capture: Capture, folder: Path) -> Any:
    """Write images and masks; return the model, a `pycolmap.Reconstruction`."""
    names = [f"{number:04d}.png" for number in range(len(capture))]

    def write_frame(number: int, frame: Frame) -> None:
        copy_image(frame, folder / "images" / names[number])
        if frame.has(Layer.MASK):
            write_mask(frame, folder / "masks" / f"{names[number]}.png")

    for_each_frame(capture.frames, "Writing COLMAP", write_frame)
    pycolmap = quiet_pycolmap()
    model = pycolmap.Reconstruction()
    cameras = list(dict.fromkeys(frame.camera.intrinsics for frame in capture.frames))
    for number, k in enumerate(cameras, start=1):
        params = [k.fx, k.fy, k.cx, k.cy]
        camera = {"model": "PINHOLE", "width": k.width, "height": k.height, "params": params}
        model.add_camera_with_trivial_rig(pycolmap.Camera(camera_id=number, **camera))
    start = start_points(capture)
    for number, (frame, name) in enumerate(zip(capture.frames, names, strict=True), start=1):
        camera = cameras.index(frame.camera.intrinsics) + 1
        image = pycolmap.Image(name=name, camera_id=camera, image_id=number)
        pose = pycolmap.Rigid3d(frame.camera.cam_from_world[:3])
        model.add_image_with_trivial_frame(image, pose)
    for place, color in zip(start.points_world, to_uint8(start.colors), strict=True):
        model.add_point3D(place.astype(np.float64), pycolmap.Track(), color)
    return model
