"""What stereo data sets are made of: the two images of a frame, their camera, and their labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.frames import integer_centered
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.files import copy_file, write_atomically


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
        """Return the capture as stereo pairs for the format ``form``.

        Raises:
            CaptureError: one eye only, or no true disparity.
        """
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
        """Write the two images, PNG; images that are PNG already are copied."""
        for layer, path in ((self.left, left), (self.right, right)):
            source = frame.layers[layer]
            if isinstance(source, Path) and source.suffix.lower() == ".png":
                copy_file(source, path)
            else:
                write_image(path, self._pixels(frame, layer))

    def _pixels(self, frame: Frame, layer: Layer) -> np.ndarray:
        if layer is Layer.IMAGE:
            return frame.load_image()
        if layer is Layer.RIGHT:
            return frame.load_right_image()
        left, right = frame.load_infrared()
        return left if layer is Layer.INFRARED_LEFT else right


def numbers_line(name: str, values: Sequence[float] | np.ndarray) -> str:
    """Return a line "name: 1.0 2.0 ..." of a calibration file."""
    return f"{name}: " + " ".join(f"{float(value):.12e}" for value in np.ravel(values)) + "\n"
