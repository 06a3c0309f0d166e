"""A sparse model of a simulated capture in the form in which structure from motion leaves it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses.from_images.colmap import ImageSet, quiet_pycolmap
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.model import write_model
from digs_warp.poses.from_images.workspace import Workspace, stage_keys
from digs_warp.record.manifest import recorded_files

POINTS = 60


def write_sparse_model(capture: Capture, folder: Path) -> None:
    """Write a workspace with a finished model: the true cameras, and points of the true depth.

    Images of a few pixels show too few features to match, so the points are projected instead.
    """
    config = replace(SfmConfig(), readout_time=capture.readout_time)
    place = Workspace(folder, stage_keys(capture.frames, config))
    with recorded_files(folder.parent, resume=True):
        place.prepare()
        write_model(_model(capture), place.model)
        place.finish_model({"models": 1, "registered": [len(capture)]})


def _model(capture: Capture) -> Any:
    pycolmap = quiet_pycolmap()
    model = pycolmap.Reconstruction()
    k = capture.frames[0].camera.intrinsics
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(
            model="PINHOLE",
            width=k.width,
            height=k.height,
            params=[k.fx, k.fy, k.cx, k.cy],
            camera_id=1,
        )
    )
    points = _points(capture)
    names = ImageSet.of(capture.frames).names
    for number, (frame, name) in enumerate(zip(capture.frames, names, strict=True), start=1):
        places = [pycolmap.Point2D(xy) for xy in _project(points, frame.camera)]
        image = pycolmap.Image(name=name, camera_id=1, image_id=number, points2D=places)
        pose = pycolmap.Rigid3d(invert_rigid(frame.camera.world_from_cam)[:3])
        model.add_image_with_trivial_frame(image, pose)
    for index, point in enumerate(points):
        track = pycolmap.Track()
        for number in range(1, len(capture) + 1):
            track.add_element(number, index)
        model.add_point3D(point, track, np.array([100, 120, 140], np.uint8))
    model.update_point_3d_errors()
    return model


def _points(capture: Capture) -> np.ndarray:
    """Return points on the object, (n, 3)."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(POINTS, 3))
    return 0.2 * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _project(points: np.ndarray, camera: Camera) -> np.ndarray:
    k = camera.intrinsics
    x, y, z = (points @ camera.cam_from_world[:3, :3].T + camera.cam_from_world[:3, 3]).T
    return np.stack([k.fx * x / z + k.cx, k.fy * y / z + k.cy], axis=1)
