"""A simulated capture as other programs leave one."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image

BASELINE = 0.1  # [m]

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
