"""KITTI's stereo, flow and scene flow benchmark of 2015: 16-bit PNG files of disparity and flow.

    training/image_2/000000_10.png        left image; image_3: right image; _11: those of the next frame
    training/disp_occ_0/000000_10.png     disparity * 256, 0: unknown; disp_noc_0: only what both eyes see
    training/disp_occ_1/000000_10.png     disparity in the next frame, at the pixels of this one
    training/flow_occ/000000_10.png       red, green: flow * 64 + 2^15; blue: 1 where known; flow_noc likewise
    training/calib_cam_to_cam/000000.txt  projections of the rectified cameras 2 and 3

A scene is a frame and the next one. Without flow each scene is a single frame, and there are no files _11.
See the development kit of https://www.cvlibs.net/datasets/kitti/eval_scene_flow.php.
"""

import logging
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Occlusion
from digs_warp.formats.captures.frames import LARGEST_UINT16, for_each_frame
from digs_warp.formats.captures.stereo_pair import StereoExport, numbers_line
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.files import write_atomically

logger = logging.getLogger(__name__)

SPLIT = "training"

UNITS_PER_DISPARITY = 256.0
UNITS_PER_FLOW, ZERO_FLOW = 64.0, 1 << 15


def write_kitti_stereo(capture: Capture, folder: Path) -> None:
    """Write the capture in the layout of KITTI's training data of 2015.

    Raises:
        CaptureError: no stereo pairs, or no true disparity.
    """
    pairs = StereoExport.of(capture, "KITTI")
    frames = capture.frames[:-1] if pairs.has_flow else capture.frames
    split = folder / SPLIT

    def write_scene(number: int, frame: Frame) -> int:
        name = f"{number:06d}"
        _copy_pair(pairs, frame, split, f"{name}_10.png")
        disparity, seen = frame.load_disparity(), frame.load_occlusion() == Occlusion.SEEN
        encoded, lost = encode_disparity(disparity)
        _write_both(split, "disp_{}_0", f"{name}_10.png", encoded, seen)
        if pairs.has_flow:
            _copy_pair(pairs, capture.frames[number + 1], split, f"{name}_11.png")
            later, lost_later = encode_disparity(disparity + frame.load_disparity_change())
            write_image(split / f"disp_occ_1/{name}_10.png", later)
            flow, lost_flow = encode_flow(frame.load_flow())
            seen = frame.load_flow_occlusion() == Occlusion.SEEN
            _write_both(split, "flow_{}", f"{name}_10.png", flow, seen)
            lost += lost_later + lost_flow
        calibration = calib_cam_to_cam(pairs.camera(frame), pairs.baseline)
        write_atomically(split / f"calib_cam_to_cam/{name}.txt", calibration.encode())
        return lost

    lost = sum(for_each_frame(frames, "Writing KITTI", write_scene))
    if lost:
        logger.warning(
            "KITTI holds disparities from 0 to 256 px and flow up to 512 px: %d values outside are written "
            "as unknown",
            lost,
        )


def encode_disparity(disparity: np.ndarray) -> tuple[np.ndarray, int]:
    """Return disparity as KITTI's 16-bit numbers, 0 where unknown, and how many are out of range.

    Args:
        disparity: [px], (height, width), NaN where unknown.
    """
    known = np.isfinite(disparity)
    units = np.round(np.where(known, disparity, 0.0).astype(np.float64) * UNITS_PER_DISPARITY)
    fits = known & (disparity > 0) & (units <= LARGEST_UINT16)
    # 0 means unknown: the smallest disparities become 1, as in the development kit.
    encoded = np.where(fits, np.maximum(units, 1), 0).astype(np.uint16)
    return encoded, int(np.count_nonzero(known & ~fits))


def encode_flow(flow: np.ndarray) -> tuple[np.ndarray, int]:
    """Return flow as KITTI's three 16-bit channels, and how many pixels are out of range.

    Args:
        flow: to the right and down [px], (height, width, 2), NaN where unknown.
    """
    known = np.isfinite(flow[..., 0]) & np.isfinite(flow[..., 1])
    units = np.round(np.where(known[..., None], flow, 0.0).astype(np.float64) * UNITS_PER_FLOW)
    units += ZERO_FLOW
    fits = known & (units.min(axis=-1) >= 0) & (units.max(axis=-1) <= LARGEST_UINT16)
    encoded = np.dstack([np.where(fits[..., None], units, 0), fits])
    return encoded.astype(np.uint16), int(np.count_nonzero(known & ~fits))


def calib_cam_to_cam(k: Intrinsics, baseline: float) -> str:
    """Return KITTI's calibration: camera 2 is the left eye, camera 3 the right one, ``baseline`` [m] beside.

    ``k`` has the center of the first pixel at (0, 0), as KITTI counts.
    """
    lines = ""
    for name, place in (("02", 0.0), ("03", baseline)):
        projection = k.matrix @ np.column_stack([np.eye(3), [-place, 0.0, 0.0]])
        lines += numbers_line(f"S_{name}", [k.width, k.height])
        lines += numbers_line(f"K_{name}", k.matrix)
        lines += numbers_line(f"D_{name}", np.zeros(5))
        lines += numbers_line(f"R_{name}", np.eye(3))
        lines += numbers_line(f"T_{name}", [-place, 0.0, 0.0])
        lines += numbers_line(f"S_rect_{name}", [k.width, k.height])
        lines += numbers_line(f"R_rect_{name}", np.eye(3))
        lines += numbers_line(f"P_rect_{name}", projection)
    return lines


def _copy_pair(pairs: StereoExport, frame: Frame, split: Path, name: str) -> None:
    pairs.copy_pair(frame, split / "image_2" / name, split / "image_3" / name)


def _write_both(
    split: Path, pattern: str, name: str, encoded: np.ndarray, seen: np.ndarray
) -> None:
    """Write all values, and those of the points that both images show."""
    both = np.where(seen.reshape(*seen.shape, *[1] * (encoded.ndim - 2)), encoded, 0)
    write_image(split / pattern.format("occ") / name, encoded)
    write_image(split / pattern.format("noc") / name, both.astype(np.uint16))
