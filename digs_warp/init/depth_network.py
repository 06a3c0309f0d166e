"""A network that guesses depth from one photograph, as an ONNX file that the user has.

Such networks (MiDaS, Depth Anything, ZoeDepth, ...) share their form: an image of ImageNet's statistics in,
a map of depth or of inverse depth out, right up to a factor, and inverse depth also up to an offset.
"""

from pathlib import Path
from typing import Any, get_args

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.device.onnx_network import open_network
from digs_warp.init.mono_config import DepthKind

# The file's own metadata may say which kind its depth is.
KIND_KEY = "depth"

MEANS, DEVIATIONS = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])

# Where the file leaves the size open: the longer side and the multiple of which sides are (patches of ViTs).
LONGER_SIDE, PATCH = 518, 14

_WHAT = "depth network"


class DepthNetwork:
    """A loaded network.

    Args:
        path: an ONNX file with one image input (1, 3, height, width), whose height and width may be open,
            and a map as its first output: (height, width) but for dimensions of 1.
        threads: cores it may use.
        kind: what the map holds; None: as the file's metadata say.

    Raises:
        DigsError: no such file, not a network of that form, or nothing says of which kind it is.
    """

    def __init__(self, path: Path, threads: int, kind: DepthKind | None = None) -> None:
        require_file(path, _WHAT, "Name an ONNX file with --mono-depth")
        self._path = path
        self._session = open_network(path, threads, _WHAT, "export it again as ONNX")
        self.kind: DepthKind = kind or self._kind_in_file()
        inputs = self._session.get_inputs()
        shape = list(inputs[0].shape)
        if len(inputs) != 1 or len(shape) != 4 or shape[1] != 3:
            found = ", ".join(f"{each.name} {each.shape}" for each in inputs)
            raise DigsError(
                f"{_WHAT} '{path}': inputs {found}, expected one image of (1, 3, height, width); export the "
                "network alone, without its preprocessing"
            )
        self._name: str = inputs[0].name
        self._size = shape[2:]

    def depth(self, image: np.ndarray) -> np.ndarray:
        """Return the map of an sRGB image (height, width, 3) uint8: (height, width), float32."""
        from PIL import Image

        height, width = image.shape[:2]
        rows, columns = self._input_size(width, height)
        resized = Image.fromarray(image).resize((columns, rows), Image.Resampling.BICUBIC)
        values = (np.asarray(resized, dtype=np.float64) / 255 - MEANS) / DEVIATIONS
        values = values.transpose(2, 0, 1)[None].astype(np.float32)
        found = np.squeeze(self._run(values))
        if found.ndim != 2:
            raise DigsError(
                f"{_WHAT} '{self._path}': its first output has shape {found.shape}, expected one map"
            )
        back = Image.fromarray(found.astype(np.float32))
        return np.asarray(back.resize((width, height), Image.Resampling.BILINEAR))

    def _run(self, values: np.ndarray) -> np.ndarray:
        try:
            return np.asarray(self._session.run(None, {self._name: values})[0])
        except Exception as error:  # onnxruntime's errors share no base class but Exception
            raise DigsError(
                f"{_WHAT} '{self._path}': cannot run on an image of {values.shape} ({error}); export "
                "it with a fixed size"
            ) from error

    def _input_size(self, width: int, height: int) -> tuple[int, int]:
        """Return height and width of the input; open ones keep the shape of the image."""
        shrink = LONGER_SIDE / max(width, height)
        fitting = [PATCH * max(1, round(side * shrink / PATCH)) for side in (height, width)]
        rows, columns = (
            size if isinstance(size, int) and size > 0 else open_size
            for size, open_size in zip(self._size, fitting, strict=True)
        )
        return rows, columns

    def _kind_in_file(self) -> Any:
        found = self._session.get_modelmeta().custom_metadata_map.get(KIND_KEY)
        kinds = get_args(DepthKind)
        if found not in kinds:
            raise DigsError(
                f"{_WHAT} '{self._path}': nothing says whether it gives inverse or metric depth; add "
                f"--mono-depth-kind with one of {', '.join(kinds)}"
            )
        return found
