"""Data sets of stereo pairs: Middlebury of 2014, and Scene Flow.

Middlebury's stereo data sets of 2014: a folder for each pair, disparity as float images (PFM).

    0000/im0.png  im1.png      left and right image
    0000/disp0.pfm  disp1.pfm  their disparity [px], infinite where unknown
    0000/mask0nocc.png         255: both eyes see it, 128: occluded, 0: unknown (as in MiddEval3)
    0000/calib.txt             focal length and principal point [px], baseline [mm]

See https://vision.middlebury.edu/stereo/data/scenes2014/ and the development kit of MiddEval3.

The Scene Flow data sets in the layout of FlyingThings3D: float images (PFM) of disparity and flow.

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
from digs_warp.data.images import MM_PER_METRE, write_image
from digs_warp.data.layers import Occlusion
from digs_warp.formats.captures.frames import for_each_frame
from digs_warp.formats.captures.stereo_pair import StereoExport, write_pfm
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.files import write_atomically

SEEN, OCCLUDED, UNKNOWN = 255, 128, 0


def write_middlebury(capture: Capture, folder: Path) -> None:
    """Write every frame as a scene of Middlebury's.

    Raises:
        CaptureError: no stereo pairs, or no true disparity.
    """
    pairs = StereoExport.of(capture, "Middlebury")

    def write_scene(number: int, frame: Frame) -> None:
        scene = folder / f"{number:04d}"
        pairs.copy_pair(frame, scene / "im0.png", scene / "im1.png")
        left, right = frame.load_disparity(), frame.load_disparity_right()
        write_pfm(scene / "disp0.pfm", np.nan_to_num(left, nan=np.inf))
        write_pfm(scene / "disp1.pfm", np.nan_to_num(right, nan=np.inf))
        both = frame.load_occlusion() == Occlusion.SEEN
        mask = np.where(np.isfinite(left), np.where(both, SEEN, OCCLUDED), UNKNOWN)
        write_image(scene / "mask0nocc.png", mask.astype(np.uint8))
        calibration = calib_txt(pairs.camera(frame), pairs.baseline, left)
        write_atomically(scene / "calib.txt", calibration.encode())

    for_each_frame(capture.frames, "Writing Middlebury", write_scene)


def calib_txt(k: Intrinsics, baseline: float, disparity: np.ndarray) -> str:
    """Return Middlebury's calibration: depth [mm] = baseline * f / (disparity + doffs).

    Args:
        k: of either eye, with the center of the first pixel at (0, 0), as OpenCV counts.
        baseline: [m].
        disparity: of the left image [px], NaN where unknown; ndisp, vmin and vmax bound it.
    """
    known = disparity[np.isfinite(disparity)]
    least, most = (known.min(), known.max()) if known.size else (0.0, 0.0)
    camera = f"[{k.fx:.9g} 0 {k.cx:.9g}; 0 {k.fy:.9g} {k.cy:.9g}; 0 0 1]"
    facts = {
        "cam0": camera,
        "cam1": camera,
        "doffs": 0,
        "baseline": f"{baseline * MM_PER_METRE:.9g}",
        "width": k.width,
        "height": k.height,
        "ndisp": int(np.ceil(most)) + 1,
        "isint": 0,
        "vmin": int(np.floor(least)),
        "vmax": int(np.ceil(most)),
        "dyavg": 0,
        "dymax": 0,
    }
    return "".join(f"{name}={value}\n" for name, value in facts.items())


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
