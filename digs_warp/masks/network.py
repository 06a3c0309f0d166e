"""Masks by isnet-general-use, the network of the paper, as the program rembg runs it.

The network is that of Qin et al., "Highly accurate dichotomous image segmentation", ECCV 2022. What happens
to the image before and after it is part of the result, so each step is that of rembg: Lanczos to 1024 x 1024
whatever the shape, division by the brightest value, fixed means, the first output stretched to 0..255,
Lanczos back.

The network often takes what the object stands on, or nothing. Where there is depth, its foreground says where
to look, and what is surely not the object; the network knows the border (`mask_in_foreground`).
"""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.device.libraries import open_network
from digs_warp.masks.from_depth import OBJECT, mask_from_depth

MODEL_FILE = "isnet-general-use.onnx"
MODEL_URL = "https://github.com/danielgatis/rembg/releases/download/v0.0.0/" + MODEL_FILE

INPUT_SIZE = 1024
MEANS = (0.485, 0.456, 0.406)

# The network sees the foreground with this much around it, as a share of its larger side.
AROUND = 0.15

# It may add pixels up to this far from the foreground, as a share of the image's longer side: the depth of
# borders is missing or wrong.
BORDER = 0.015

# A network that finds less than this share of the foreground has not found the object.
LEAST_FOUND = 0.5


def default_model_path() -> Path:
    """Return where rembg keeps the network: $U2NET_HOME, or .u2net in $XDG_DATA_HOME or the home folder."""
    base = os.environ.get("XDG_DATA_HOME", "~")
    return (
        Path(os.environ.get("U2NET_HOME", os.path.join(base, ".u2net"))).expanduser() / MODEL_FILE
    )


def require_network(path: Path) -> None:
    """Raise a `DigsError` when the file of the network is missing."""
    hint = f"Download {MODEL_URL} there, or name a file with --mask-model"
    require_file(path, "mask network", hint)


class MaskNetwork:
    """A loaded network; `mask` may be called from several threads.

    Args:
        path: an ONNX file with one image input (1, 3, 1024, 1024) and a map (1, 1, height, width) as its
            first output.
        threads: cores it may use.
    """

    def __init__(self, path: Path, threads: int) -> None:
        require_network(path)
        self._path = path
        self._session = open_network(
            path, threads, "mask network", f"download it again from {MODEL_URL}"
        )
        self._input = self._session.get_inputs()[0].name

    def mask(self, image: np.ndarray) -> np.ndarray:
        """Return the mask of an sRGB image (height, width, 3) uint8: (height, width), uint8."""
        height, width = image.shape[:2]
        outputs = self._session.run(None, {self._input: network_input(image)})
        if outputs[0].ndim != 4 or outputs[0].shape[:2] != (1, 1):
            raise DigsError(
                f"mask network '{self._path}': its first output has shape {outputs[0].shape}, expected "
                f"(1, 1, height, width); use {MODEL_FILE}"
            )
        return mask_from_output(outputs[0][0, 0], width, height)


def network_input(image: np.ndarray) -> np.ndarray:
    """Return what the network sees of an image (height, width, 3) uint8: (1, 3, 1024, 1024), float32."""
    from PIL import Image

    resized = Image.fromarray(image).resize((INPUT_SIZE, INPUT_SIZE), Image.Resampling.LANCZOS)
    values = np.asarray(resized, dtype=np.float64)
    values = values / max(float(values.max()), 1e-6) - MEANS
    return values.transpose(2, 0, 1)[None].astype(np.float32)


def mask_from_output(output: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return the mask (height, width), uint8, of the network's map; a constant map is no object."""
    from PIL import Image

    low, high = float(output.min()), float(output.max())
    if not high > low:  # rembg would divide by zero here
        return np.zeros((height, width), np.uint8)
    stretched = ((output - low) / (high - low) * 255).astype(np.uint8)
    resized = Image.fromarray(stretched).resize((width, height), Image.Resampling.LANCZOS)
    return np.asarray(resized)


def mask_in_foreground(
    network: Callable[[np.ndarray], np.ndarray], image: np.ndarray, depth: np.ndarray
) -> np.ndarray:
    """Return the network's mask inside the depth's foreground, (height, width), uint8.

    Where the network finds nothing there, the foreground itself; where the depth has none, an empty mask.

    Args:
        network: from an sRGB image (height, width, 3) uint8 to its mask, (height, width) uint8.
        image: sRGB, shape (height, width, 3), uint8.
        depth: planar depth [m], shape (height, width), NaN where unknown.
    """
    import cv2

    foreground = mask_from_depth(image, depth)
    inside = foreground > OBJECT // 2
    if not inside.any():
        return foreground
    part = _box(inside)
    found = np.zeros_like(foreground)
    found[part] = network(np.ascontiguousarray(image[part]))
    reach = round(BORDER * max(inside.shape))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    found[cv2.dilate(inside.astype(np.uint8), kernel) == 0] = 0
    share = np.count_nonzero(inside & (found > OBJECT // 2)) / np.count_nonzero(inside)
    return found if share >= LEAST_FOUND else foreground


def _box(inside: np.ndarray) -> tuple[slice, slice]:
    """Return rows and columns around the pixels, with AROUND more on each side."""
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    more = round(AROUND * max(np.ptp(rows), np.ptp(columns)))
    return (
        slice(max(0, int(rows[0]) - more), int(rows[-1]) + 1 + more),
        slice(max(0, int(columns[0]) - more), int(columns[-1]) + 1 + more),
    )
