"""Middlebury's stereo data sets of 2014: a folder for each pair, disparity as float images (PFM).

    0000/im0.png  im1.png      left and right image
    0000/disp0.pfm  disp1.pfm  their disparity [px], infinite where unknown
    0000/mask0nocc.png         255: both eyes see it, 128: occluded, 0: unknown (as in MiddEval3)
    0000/calib.txt             focal length and principal point [px], baseline [mm]

See https://vision.middlebury.edu/stereo/data/scenes2014/ and the development kit of MiddEval3.
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
