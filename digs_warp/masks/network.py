"""Masks by isnet-general-use, the network of the paper, as the program rembg runs it.

The network is that of Qin et al., "Highly accurate dichotomous image segmentation", ECCV 2022. What happens
to the image before and after it is part of the result, so each step is that of rembg: Lanczos to 1024 x 1024
whatever the shape, division by the brightest value, fixed means, the first output stretched to 0..255,
Lanczos back.
"""

import os
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.device.libraries import open_network

MODEL_FILE = "isnet-general-use.onnx"
MODEL_URL = "https://github.com/danielgatis/rembg/releases/download/v0.0.0/" + MODEL_FILE

INPUT_SIZE = 1024
MEANS = (0.485, 0.456, 0.406)


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
