"""Real recordings of the sample data as captures in memory."""

from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.to_capture import nearly_rigid
from digs_warp.geometry.camera import Camera, Intrinsics


def recorded(folder: Path, kind: str) -> Capture:
    """A real recording: 'hololens_room_sequence' or 'tum_cabinet_orbit'."""
    if kind == "hololens_room_sequence":
        k = np.loadtxt(folder / "K.txt")
        intrinsics = Intrinsics(540, 360, k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5)
        poses = np.loadtxt(folder / "poses.txt").reshape(-1, 4, 4)
        colors, scale = "images", 1000
    else:
        from scipy.spatial.transform import Rotation

        intrinsics = Intrinsics(640, 480, 535.4, 539.2, 320.6, 248.1)
        rows = np.loadtxt(folder / "truth_cam_poses.txt")
        poses = np.tile(np.eye(4), (len(rows), 1, 1))
        poses[:, :3, :3] = Rotation.from_quat(rows[:, 4:8]).as_matrix()
        poses[:, :3, 3] = rows[:, 1:4]
        colors, scale = "rgb", 5000
    images, depths = (sorted((folder / name).iterdir()) for name in (colors, "depth"))
    frames = []
    for image, depth, pose in zip(images, depths, poses, strict=True):
        metres = read_image(depth, "depth")[..., 0].astype(np.float32) / scale
        layers = {Layer.IMAGE: image, Layer.DEPTH: metres}
        camera = Camera(intrinsics, nearly_rigid(pose, image.name))
        frames.append(Frame(image.stem, camera, float(len(frames)), layers))
    return Capture(None, tuple(frames), None)
