"""A simulated capture in the layouts of 7-Scenes and EuRoC."""

from pathlib import Path

import numpy as np

from digs_warp.data.capture import read_capture
from digs_warp.data.images import write_image
from digs_warp.geometry.rigid import quat_xyzw_from_matrix

BASELINE = 0.1  # [m]


def write_seven_scenes(capture: Path, folder: Path) -> None:
    """Write color, depth and pose of each frame, and both kinds of calibration."""
    folder.mkdir()
    frames = read_capture(capture).frames
    for number, frame in enumerate(frames):
        start = folder / f"frame-{number:06d}"
        write_image(start.with_suffix(".color.png"), frame.load_image())
        depth = np.nan_to_num(frame.load_depth(), nan=0, posinf=0, neginf=0)
        write_image(start.with_suffix(".depth.png"), (1000 * depth).astype(np.uint16))
        np.savetxt(start.with_suffix(".pose.txt"), frame.camera.world_from_cam)
    matrix = frames[0].camera.intrinsics.matrix
    np.savetxt(folder / "camera-intrinsics.txt", matrix)
    whole = np.eye(4)
    whole[:3, :3] = matrix
    numbers = " ".join(map(str, whole.ravel()))
    lines = [f"m_calibration{kind}Intrinsic = {numbers}" for kind in ("Color", "Depth")]
    (folder / "info.txt").write_text("\n".join(["m_depthShift = 1000", *lines]) + "\n")


def write_euroc(capture: Path, folder: Path) -> None:
    """Write left and right images with mild lenses, and the poses of the left camera as those of the body."""
    rows = []
    for frame in read_capture(capture).frames:
        time = 10**15 + round(1e9 * frame.time)
        write_image(folder / f"mav0/cam0/data/{time}.png", frame.load_image())
        write_image(folder / f"mav0/cam1/data/{time}.png", frame.load_right_image())
        x, y, z, w = quat_xyzw_from_matrix(frame.camera.world_from_cam[:3, :3]).tolist()
        rows.append([time, *frame.camera.center_world.tolist(), w, x, y, z])
        k = frame.camera.intrinsics
        for eye in (0, 1):
            body_from_cam = np.eye(4)
            body_from_cam[0, 3] = eye * BASELINE
            (folder / f"mav0/cam{eye}/sensor.yaml").write_text(
                f"%YAML:1.0\nT_BS:\n  data: {body_from_cam.ravel().tolist()}\n"
                f"resolution: [{k.width}, {k.height}]\n"
                f"intrinsics: [{k.fx}, {k.fy}, {k.cx}, {k.cy}]\n"
                "distortion_model: radial-tangential\ndistortion_coefficients: [-0.1, 0.01, 0.0, 0.0]\n"
            )
    truth = folder / "mav0/state_groundtruth_estimate0"
    truth.mkdir()
    (truth / "data.csv").write_text("\n".join(",".join(map(str, row)) for row in rows) + "\n")
