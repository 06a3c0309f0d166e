# torch is optional, so type checking must pass without it:
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false
"""LPIPS: an image distance from the features of a network (Zhang et al. 2018, version 0.1).

Optional: ``pip install 'digs-warp[lpips]'`` installs torch. It needs two weight files that this package
cannot ship: the backbone (torchvision's ImageNet weights) and the calibration (from the package ``lpips``,
folder ``weights/v0.1``).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from digs_warp.checks import DigsError, check_shape, require_file

Network = Literal["alex", "vgg"]


@dataclass(frozen=True)
class _Convolution:
    """A convolution with ReLU: its index in torchvision's ``features``, and its geometry."""

    number: int
    stride: int = 1
    padding: int = 1


@dataclass(frozen=True)
class _Backbone:
    """Blocks of convolutions, separated by pooling; the features after each block are compared."""

    file: str
    blocks: tuple[tuple[_Convolution, ...], ...]
    pool_size: int
    pools_before: tuple[int, ...]


def _vgg_block(*numbers: int) -> tuple[_Convolution, ...]:
    return tuple(map(_Convolution, numbers))


_BACKBONES: dict[str, _Backbone] = {
    "alex": _Backbone(
        "alexnet-owt-7be5be79.pth",
        (
            (_Convolution(0, stride=4, padding=2),),
            (_Convolution(3, padding=2),),
            (_Convolution(6),),
            (_Convolution(8),),
            (_Convolution(10),),
        ),
        pool_size=3,
        pools_before=(1, 2),
    ),
    "vgg": _Backbone(
        "vgg16-397923af.pth",
        (
            _vgg_block(0, 2),
            _vgg_block(5, 7),
            _vgg_block(10, 12, 14),
            _vgg_block(17, 19, 21),
            _vgg_block(24, 26, 28),
        ),
        pool_size=2,
        pools_before=(1, 2, 3, 4),
    ),
}

# The networks were trained on images with this normalization; LPIPS applies it to values in -1..1.
_SHIFT = (-0.030, -0.088, -0.188)
_SCALE = (0.458, 0.448, 0.450)

# A smaller image has no pixels left after the last pooling.
MIN_SIZE = 32


class Lpips:
    """Distance of two images by the features of a network; 0 for identical images.

    Args:
        backbone: weight file of torchvision's AlexNet or VGG16.
        calibration: weight file of the linear layers, ``alex.pth`` or ``vgg.pth`` of the package ``lpips``.
        network: which of the two. "alex" is the package's default; 3DGS reports "vgg".

    Raises:
        DigsError: torch is not installed, or a file is missing or belongs to another network.
    """

    def __init__(self, backbone: Path, calibration: Path, network: Network = "alex") -> None:
        try:
            import torch
        except ImportError as error:
            raise DigsError("LPIPS needs torch: pip install 'digs-warp[lpips]'") from error
        self._torch = torch
        self._net = _BACKBONES[network]
        hint = f"expected {self._net.file} of torchvision"
        weights = _Weights(backbone, torch, hint)
        self._blocks = [
            [(c, *weights.convolution(f"features.{c.number}")) for c in block]
            for block in self._net.blocks
        ]
        weights = _Weights(calibration, torch, f"expected {network}.pth of the package lpips, v0.1")
        self._lines = [
            weights.tensor(f"lin{i}.model.1.weight", (1, len(block[-1][2]), 1, 1))
            for i, block in enumerate(self._blocks)
        ]

    def __call__(self, image: np.ndarray, target: np.ndarray) -> float:
        """Return the distance of two images, sRGB values in 0..1, shape (height, width, 3)."""
        check_shape("image", image, (None, None, 3))
        check_shape("target", target, image.shape)
        if min(image.shape[:2]) < MIN_SIZE:
            raise DigsError(
                f"LPIPS: image of {image.shape[1]}x{image.shape[0]} px, expected at least "
                f"{MIN_SIZE}x{MIN_SIZE}"
            )
        with self._torch.no_grad():
            pairs = zip(self._features(image), self._features(target), strict=True)
            # Squared difference of unit vectors, weighted by channel, averaged over the image.
            return sum(
                float(((a - b) ** 2 * line).sum(dim=1).mean())
                for (a, b), line in zip(pairs, self._lines, strict=True)
            )

    def _features(self, image: np.ndarray) -> list[Any]:
        """Return the features after each block, normalized to unit length per pixel."""
        torch = self._torch
        values = 2.0 * np.clip(np.asarray(image, np.float32), 0, 1) - 1.0
        values = (values - np.array(_SHIFT, np.float32)) / np.array(_SCALE, np.float32)
        x = torch.from_numpy(np.ascontiguousarray(values.transpose(2, 0, 1)[None]))
        features = []
        for number, block in enumerate(self._blocks):
            if number in self._net.pools_before:
                x = torch.nn.functional.max_pool2d(x, self._net.pool_size, stride=2)
            for c, weight, bias in block:
                x = torch.nn.functional.conv2d(x, weight, bias, c.stride, c.padding).relu()
            features.append(x / (x.pow(2).sum(dim=1, keepdim=True).sqrt() + 1e-10))
        return features


class _Weights:
    """Named tensors from a file saved by torch."""

    def __init__(self, path: Path, torch: Any, hint: str) -> None:
        self._path = require_file(path, "LPIPS weights", hint)
        self._hint = hint
        try:
            # weights_only: a pickle from an unknown source must not run code.
            self._state = torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:  # torch passes on any error of its unpickler
            raise DigsError(f"LPIPS weights '{path}': cannot be read; {hint}") from error
        if not isinstance(self._state, dict):
            found = type(self._state).__name__
            raise DigsError(f"LPIPS weights '{path}': {found}, expected named tensors; {hint}")

    def convolution(self, name: str) -> tuple[Any, Any]:
        """Return weight and bias."""
        weight = self.tensor(f"{name}.weight")
        return weight, self.tensor(f"{name}.bias", (len(weight),))

    def tensor(self, name: str, shape: tuple[int, ...] | None = None) -> Any:
        """Return a tensor; check its shape if one is given."""
        found = self._state.get(name)
        if found is None or tuple(found.shape) != (shape or tuple(found.shape)):
            what = "not there" if found is None else tuple(found.shape)
            raise DigsError(
                f"LPIPS weights '{self._path}': '{name}' is {what}, expected {shape or 'a tensor'}; "
                f"{self._hint}"
            )
        return found.float()
