"""A simulated capture as other programs leave one, and the model that structure from motion finds in it."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses.from_images.colmap import ImageSet, quiet_pycolmap
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.model import write_model
from digs_warp.poses.from_images.workspace import Workspace, stage_keys
from digs_warp.record.manifest import recorded_files

BASELINE = 0.1  # [m]
POINTS = 60  # of a sparse model

Frames = Sequence[Frame]


def millimetres(frame: Frame) -> np.ndarray:
    """Return the depth as 16-bit numbers, 0 where there is none."""
    depth = np.nan_to_num(frame.load_depth(), nan=0, posinf=0, neginf=0)
    return (1000 * depth).astype(np.uint16)


def write_seven_scenes(frames: Frames, folder: Path) -> None:
    """Write color, depth and pose of each frame, and both kinds of calibration."""
    for number, frame in enumerate(frames):
        start = folder / f"frame-{number:06d}"
        write_image(start.with_suffix(".color.png"), frame.load_image())
        write_image(start.with_suffix(".depth.png"), millimetres(frame))
        np.savetxt(start.with_suffix(".pose.txt"), frame.camera.world_from_cam)
    whole = _matrix(frames)
    np.savetxt(folder / "camera-intrinsics.txt", whole[:3, :3])
    numbers = " ".join(map(str, whole.ravel()))
    lines = [f"m_calibration{kind}Intrinsic = {numbers}" for kind in ("Color", "Depth")]
    (folder / "info.txt").write_text("\n".join(["m_depthShift = 1000", *lines]) + "\n")


def write_scannet(frames: Frames, folder: Path) -> None:
    """Write color, depth, poses and the matrices of both cameras."""
    for name in ("intrinsic", "pose"):
        (folder / name).mkdir()
    for kind in ("color", "depth"):
        np.savetxt(folder / f"intrinsic/intrinsic_{kind}.txt", _matrix(frames))
    for number, frame in enumerate(frames):
        write_image(folder / f"color/{number}.png", frame.load_image())
        write_image(folder / f"depth/{number}.png", millimetres(frame))
        np.savetxt(folder / f"pose/{number}.txt", frame.camera.world_from_cam)


def write_zed(frames: Frames, folder: Path) -> None:
    """Write both images, depth in both formats, and the calibration."""
    for number, frame in enumerate(frames):
        write_image(folder / f"left{number:06d}.png", frame.load_image())
        write_image(folder / f"right{number:06d}.png", frame.load_right_image())
        write_image(folder / f"depth{number:06d}.exr", frame.load_depth())
        np.save(folder / f"depth{number:06d}.npy", frame.load_depth())
    k = frames[0].camera.intrinsics
    calibration = {"fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "baseline": 0.12}
    (folder / "calibration.json").write_text(json.dumps(calibration))


def write_record3d(frames: Frames, folder: Path) -> None:
    """Write color, depth, and the index with the poses."""
    for number, frame in enumerate(frames):
        write_image(folder / f"rgb/{number}.png", frame.load_image())
        write_image(folder / f"depth/{number}.exr", frame.load_depth())
    k = frames[0].camera.intrinsics
    matrix = [k.fx, 0, 0, 0, k.fy, 0, k.cx, k.cy, 1]
    poses = [[0, 0, 0, 1, 0.1 * number, 0, 0] for number in range(len(frames))]
    content = {"K": matrix, "w": k.width, "h": k.height, "fps": 30, "poses": poses}
    (folder / "metadata.json").write_text(json.dumps(content))


def _matrix(frames: Frames) -> np.ndarray:
    """Return the calibration as a 4x4 matrix."""
    whole = np.eye(4)
    whole[:3, :3] = frames[0].camera.intrinsics.matrix
    return whole


WRITERS: Mapping[str, Callable[[Frames, Path], None]] = {
    "7scenes": write_seven_scenes,
    "scannet": write_scannet,
    "zed": write_zed,
    "record3d": write_record3d,
}


def write_sparse_model(capture: Capture, folder: Path) -> None:
    """Write a workspace with a finished model: the true cameras, and points of the true depth.

    Images of a few pixels show too few features to match, so the points are projected instead.
    """
    config = SfmConfig(readout_time=capture.readout_time)
    place = Workspace(folder, stage_keys(capture.frames, config))
    with recorded_files(folder.parent, resume=True):
        place.prepare()
        write_model(_model(capture), place.model)
        place.finish_model({"models": 1, "registered": [len(capture)]})


def _model(capture: Capture) -> Any:
    pycolmap = quiet_pycolmap()
    model = pycolmap.Reconstruction()
    k = capture.frames[0].camera.intrinsics
    size = {"width": k.width, "height": k.height}
    focal = {"model": "PINHOLE", "params": [k.fx, k.fy, k.cx, k.cy]}
    model.add_camera_with_trivial_rig(pycolmap.Camera(camera_id=1, **size, **focal))
    directions = np.random.default_rng(0).normal(size=(POINTS, 3))  # of points on the object
    points = 0.2 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    names = ImageSet.of(capture.frames).names
    for number, (frame, name) in enumerate(zip(capture.frames, names, strict=True), start=1):
        places = [pycolmap.Point2D(xy) for xy in frame.camera.project(points)[0]]
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
