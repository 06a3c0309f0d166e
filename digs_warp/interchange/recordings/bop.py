"""BOP: a scene of the benchmark of object poses (see `digs_warp.interchange.bop`).

Where the images tell no pose of the camera in the world, the first object is taken for the world: it is what
a scene of one object is about.
"""

from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.geometry import rigid
from digs_warp.interchange.bop import MM_PER_METRE
from digs_warp.interchange.recordings.files import (
    IMAGE_SUFFIXES,
    image_size,
    intrinsics_of_matrix,
    numbered_files,
    require_files,
)
from digs_warp.interchange.recordings.recording import RecordedFrame, Recording
from digs_warp.record.files import read_json

CAMERAS = "scene_camera.json"


def read_bop(folder: Path) -> Recording:
    """Read one scene: the folder with scene_camera.json, or a data set that holds exactly one.

    Raises:
        CaptureError: no or several scenes, no images, or entries without a camera.
    """
    scene = _the_scene(folder)
    images = require_files(scene, numbered_files(scene / "rgb", IMAGE_SUFFIXES), "rgb/*.png")
    depths = numbered_files(scene / "depth", (".png",))
    cameras = read_json(scene / CAMERAS, "cameras")
    poses = (
        read_json(scene / "scene_gt.json", "poses") if (scene / "scene_gt.json").is_file() else {}
    )
    size = image_size(next(iter(images.values())))
    frames = []
    for number, image in images.items():
        try:
            camera = cameras[str(number)]
            matrix = np.array(camera["cam_K"], dtype=np.float64).reshape(3, 3)
            cam_from_world = _cam_from_world(camera, poses.get(str(number)) or [])
            scale = float(camera.get("depth_scale", 1.0))
        except (KeyError, TypeError, ValueError) as error:
            raise CaptureError(f"'{scene / CAMERAS}', image {number}: {error!r}") from None
        masks = [scene / kind / f"{number:06d}_000000.png" for kind in ("mask_visib", "mask")]
        frames.append(
            RecordedFrame(
                image=image,
                intrinsics=intrinsics_of_matrix(matrix, size, integer_centers=True),
                time=float(number),
                world_from_cam=None if cam_from_world is None else np.linalg.inv(cam_from_world),
                depth=depths.get(number),
                depth_units_per_metre=MM_PER_METRE / scale,
                mask=next((path for path in masks if path.is_file()), None),
            )
        )
    return Recording(scene, tuple(frames))


def _the_scene(folder: Path) -> Path:
    if (folder / CAMERAS).is_file():
        return folder
    scenes = sorted(path.parent for path in folder.glob(f"*/*/{CAMERAS}"))
    if len(scenes) != 1:
        raise CaptureError(
            f"recording '{folder}': {len(scenes)} scenes of BOP in it ({CAMERAS} marks one); name the "
            "folder of one"
        )
    return scenes[0]


def _cam_from_world(camera: dict[str, Any], objects: list[dict[str, Any]]) -> np.ndarray | None:
    """The pose of the world, or of the first object, in the camera [m]."""
    if "cam_R_w2c" in camera:
        rotation, translation = camera["cam_R_w2c"], camera["cam_t_w2c"]
    elif objects:
        rotation, translation = objects[0]["cam_R_m2c"], objects[0]["cam_t_m2c"]
    else:
        return None
    return rigid(
        np.array(rotation, dtype=np.float64).reshape(3, 3), np.array(translation) / MM_PER_METRE
    )
