"""Data sets of stereo pairs: Middlebury of 2014, Scene Flow as FlyingThings3D, and KITTI of 2015.

docs/formats.md has their layouts. Torchvision's SceneFlowStereo and FlyingThings3D read the folder that holds
SceneFlow. In KITTI a scene is a frame and the next one; without flow each is a single frame, and there are no
files _11. See the development kits of MiddEval3 and of KITTI's scene flow.
"""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import MM_PER_METRE, write_image
from digs_warp.data.layers import Layer, Occlusion
from digs_warp.formats.captures.frames import (
    LARGEST_UINT16,
    copy_image,
    for_each_frame,
    integer_centered,
)
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.files import write_atomically

logger = logging.getLogger(__name__)


def write_pfm(path: Path, values: np.ndarray) -> None:
    """Write an image of one or three channels.

    Args:
        path: the file.
        values: shape (height, width) or (height, width, 3), float32.
    """
    import cv2

    write_atomically(
        path, cv2.imencode(".pfm", values[..., ::-1] if values.ndim == 3 else values)[1].tobytes()
    )


# The layers of the labels; `digs_warp.sim.record.labels.names` has all of them.
DISPARITY = (Layer.DISPARITY, Layer.DISPARITY_RIGHT, Layer.OCCLUSION, Layer.OCCLUSION_RIGHT)
FLOW = (Layer.FLOW, Layer.FLOW_OCCLUSION)


@dataclass(frozen=True, eq=False)
class StereoExport:
    """A capture whose frames are stereo pairs with true disparity.

    Attributes:
        capture: the recording.
        baseline: of the eyes [m].
        left, right: layers of the images.
        has_flow: whether all frames but the last have flow of the left image.
    """

    capture: Capture
    baseline: float
    left: Layer
    right: Layer
    has_flow: bool

    @staticmethod
    def of(capture: Capture, form: str) -> "StereoExport":
        """Return the capture as stereo pairs for the format ``form``."""
        if capture.rig is None:
            raise CaptureError(
                f"{capture}: recorded with one eye, but {form} holds stereo pairs; record it with "
                "'digs-warp simulate --labels disparity'"
            )
        is_infrared = capture.rig.infrared is not None
        pair = (
            (Layer.INFRARED_LEFT, Layer.INFRARED_RIGHT)
            if is_infrared
            else (Layer.IMAGE, Layer.RIGHT)
        )
        for frame in capture.frames:
            if missing := [layer for layer in (*pair, *DISPARITY) if not frame.has(layer)]:
                raise CaptureError(
                    f"{capture}, frame '{frame.name}': no {missing[0].label} ({missing[0].value}), which "
                    f"{form} needs; record again with 'digs-warp simulate --labels disparity'"
                )
        # The flow of an infrared capture is that of its color image.
        moving = [frame for frame in capture.frames[:-1] if all(map(frame.has, FLOW))]
        has_flow = len(capture) > 1 and len(moving) == len(capture) - 1 and not is_infrared
        return StereoExport(capture, capture.rig.baseline, *pair, has_flow)

    def camera(self, frame: Frame) -> Intrinsics:
        """Return the camera of either eye, with the center of the first pixel at (0, 0)."""
        k, rig = frame.camera.intrinsics, self.capture.rig
        if rig is not None and rig.infrared is not None:
            pair = rig.infrared
            k = Intrinsics(k.width, k.height, pair.fl_x, pair.fl_y, pair.cx, pair.cy)
        return integer_centered(k)

    def copy_pair(self, frame: Frame, left: Path, right: Path) -> None:
        """Write the two images, PNG."""
        copy_image(frame, left, self.left)
        copy_image(frame, right, self.right)


SEEN, OCCLUDED, UNKNOWN = 255, 128, 0


def write_middlebury(capture: Capture, folder: Path) -> None:
    """Write every frame as a scene of Middlebury's."""
    pairs = StereoExport.of(capture, "Middlebury")

    def write_scene(number: int, frame: Frame) -> None:
        scene = folder / f"{number:04d}"
        pairs.copy_pair(frame, scene / "im0.png", scene / "im1.png")
        left, right = frame.load(Layer.DISPARITY), frame.load(Layer.DISPARITY_RIGHT)
        write_pfm(scene / "disp0.pfm", np.nan_to_num(left, nan=np.inf))
        write_pfm(scene / "disp1.pfm", np.nan_to_num(right, nan=np.inf))
        both = frame.load(Layer.OCCLUSION) == Occlusion.SEEN
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
    """Write the capture as a sequence of FlyingThings3D."""
    pairs = StereoExport.of(capture, "Scene Flow")
    root = folder / ROOT

    def write_frame(number: int, frame: Frame) -> None:
        name, images = f"{number:04d}", root / "frames_finalpass" / SEQUENCE
        pairs.copy_pair(frame, images / f"left/{name}.png", images / f"right/{name}.png")
        sides = {"left": frame.load(Layer.DISPARITY), "right": frame.load(Layer.DISPARITY_RIGHT)}
        for side, disparity in sides.items():
            known = np.nan_to_num(disparity, nan=UNKNOWN_DISPARITY)
            write_pfm(root / "disparity" / SEQUENCE / side / f"{name}.pfm", known)
        if pairs.has_flow and number + 1 < len(capture):
            into = f"{SEQUENCE}/into_future/left"
            flow = np.where([True, True, False], frame.load(Layer.FLOW), np.float32(0))
            flow = np.where(np.isfinite(flow).all(axis=-1, keepdims=True), flow, UNKNOWN_FLOW)
            write_pfm(root / "optical_flow" / into / f"OpticalFlowIntoFuture_{name}_L.pfm", flow)
            change = np.nan_to_num(frame.load(Layer.FLOW)[..., 2], nan=UNKNOWN_FLOW)
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


SPLIT = "training"

UNITS_PER_DISPARITY = 256.0
UNITS_PER_FLOW, ZERO_FLOW = 64.0, 1 << 15


def write_kitti_stereo(capture: Capture, folder: Path) -> None:
    """Write the capture in the layout of KITTI's training data of 2015."""
    pairs = StereoExport.of(capture, "KITTI")
    frames = capture.frames[:-1] if pairs.has_flow else capture.frames
    split = folder / SPLIT

    def eyes(name: str) -> tuple[Path, Path]:
        return split / "image_2" / name, split / "image_3" / name

    def write_scene(number: int, frame: Frame) -> int:
        name = f"{number:06d}"
        pairs.copy_pair(frame, *eyes(f"{name}_10.png"))
        disparity, seen = frame.load(Layer.DISPARITY), frame.load(Layer.OCCLUSION) == Occlusion.SEEN
        encoded, lost = encode_disparity(disparity)
        _write_both(split, "disp_{}_0", f"{name}_10.png", encoded, seen)
        if pairs.has_flow:
            pairs.copy_pair(capture.frames[number + 1], *eyes(f"{name}_11.png"))
            later, lost_later = encode_disparity(disparity + frame.load(Layer.FLOW)[..., 2])
            write_image(split / f"disp_occ_1/{name}_10.png", later)
            flow, lost_flow = encode_flow(frame.load(Layer.FLOW)[..., :2])
            seen = frame.load(Layer.FLOW_OCCLUSION) == Occlusion.SEEN
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
    lines = []
    for name, place in (("02", 0.0), ("03", baseline)):
        entries = {
            "S": [k.width, k.height],
            "K": k.matrix,
            "D": np.zeros(5),
            "R": np.eye(3),
            "T": [-place, 0.0, 0.0],
            "S_rect": [k.width, k.height],
            "R_rect": np.eye(3),
            "P_rect": k.matrix @ np.column_stack([np.eye(3), [-place, 0.0, 0.0]]),
        }
        lines += [
            f"{entry}_{name}: " + " ".join(f"{float(value):.12e}" for value in np.ravel(values))
            for entry, values in entries.items()
        ]
    return "\n".join(lines) + "\n"


def _write_both(
    split: Path, pattern: str, name: str, encoded: np.ndarray, seen: np.ndarray
) -> None:
    """Write all values, and those of the points that both images show."""
    both = np.where(seen.reshape(*seen.shape, *[1] * (encoded.ndim - 2)), encoded, 0)
    write_image(split / pattern.format("occ") / name, encoded)
    write_image(split / pattern.format("noc") / name, both.astype(np.uint16))
