"""The Scene Flow data sets in the layout of FlyingThings3D: float images (PFM) of disparity and flow.

    SceneFlow/FlyingThings3D/
      frames_finalpass/TRAIN/A/0000/left/0000.png         and right
      disparity/TRAIN/A/0000/left/0000.pfm                and right; positive in both
      optical_flow/TRAIN/A/0000/into_future/left/OpticalFlowIntoFuture_0000_L.pfm   right, down, 0
      disparity_change/TRAIN/A/0000/into_future/left/0000.pfm
      camera_data/TRAIN/A/0000/camera_data.txt            world from camera, OpenGL axes

torchvision's SceneFlowStereo and FlyingThings3D read the folder that holds SceneFlow. See
https://lmb.informatik.uni-freiburg.de/resources/datasets/SceneFlowDatasets.en.html.
"""

from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.formats.captures.frames import for_each_frame
from digs_warp.formats.captures.stereo_pair import StereoExport, write_pfm
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.files import write_atomically

ROOT = "SceneFlow/FlyingThings3D"
SEQUENCE = "TRAIN/A/0000"

# Flow files mark unknown values by numbers above 1e9; disparity has no such sign, and 0 is at infinity.
UNKNOWN_FLOW, UNKNOWN_DISPARITY = 1e10, 0.0


def write_sceneflow(capture: Capture, folder: Path) -> None:
    """Write the capture as a sequence of FlyingThings3D.

    Raises:
        CaptureError: no stereo pairs, or no true disparity.
    """
    pairs = StereoExport.of(capture, "Scene Flow")
    root = folder / ROOT

    def write_frame(number: int, frame: Frame) -> None:
        name, images = f"{number:04d}", root / "frames_finalpass" / SEQUENCE
        pairs.copy_pair(frame, images / f"left/{name}.png", images / f"right/{name}.png")
        sides = {"left": frame.load_disparity(), "right": frame.load_disparity_right()}
        for side, disparity in sides.items():
            known = np.nan_to_num(disparity, nan=UNKNOWN_DISPARITY)
            write_pfm(root / "disparity" / SEQUENCE / side / f"{name}.pfm", known)
        if pairs.has_flow and number + 1 < len(capture):
            into = f"{SEQUENCE}/into_future/left"
            flow = np.dstack([frame.load_flow(), np.zeros(frame.load_mask().shape, np.float32)])
            flow = np.where(np.isfinite(flow).all(axis=-1, keepdims=True), flow, UNKNOWN_FLOW)
            write_pfm(root / "optical_flow" / into / f"OpticalFlowIntoFuture_{name}_L.pfm", flow)
            change = np.nan_to_num(frame.load_disparity_change(), nan=UNKNOWN_FLOW)
            write_pfm(root / "disparity_change" / into / f"{name}.pfm", change)

    for_each_frame(capture.frames, "Writing Scene Flow", write_frame)
    poses = "".join(
        _camera_entry(number, frame, pairs.baseline) for number, frame in enumerate(capture.frames)
    )
    write_atomically(root / "camera_data" / SEQUENCE / "camera_data.txt", poses.encode())


def _camera_entry(number: int, frame: Frame, baseline: float) -> str:
    lines = [f"Frame {number}"]
    for side, place in (("L", 0.0), ("R", baseline)):
        pose = frame.camera.shifted_right(place).world_from_cam @ OPENCV_FROM_OPENGL
        lines.append(f"{side} " + " ".join(f"{value:.9g}" for value in pose.ravel()))
    return "\n".join(lines) + "\n\n"
