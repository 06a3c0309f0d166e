"""Pixels -> pictures in a page: color maps with fixed ranges, smaller copies, data URIs."""

import base64
from dataclasses import dataclass

import numpy as np

from digs_warp.data.images import encode_jpeg

MISSING_COLOR = np.array([128, 128, 128], dtype=np.uint8)  # gray: in none of the color maps


@dataclass(frozen=True)
class ColorScale:
    """A color map over a range of values; values outside are clamped to the range.

    Attributes:
        label: what is shown, with its unit.
        low: value at the left end.
        high: value at the right end.
        map_name: a color map of matplotlib.
    """

    label: str
    low: float
    high: float
    map_name: str

    def paint(self, values: np.ndarray) -> np.ndarray:
        """Return colors, shape (height, width, 3), uint8; NaN is gray."""
        share = np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0)
        colors = self._table()[np.nan_to_num(share * 255).astype(np.uint8)]
        return np.where(np.isnan(values)[..., None], MISSING_COLOR, colors)

    def gradient(self, stops: int = 9) -> list[str]:
        """Return evenly spaced colors from low to high, as CSS colors."""
        table = self._table()[np.linspace(0, 255, stops).astype(int)]
        return [f"rgb({r} {g} {b})" for r, g, b in table]

    def ticks(self, count: int = 5) -> list[float]:
        """Return evenly spaced values from low to high."""
        return [float(value) for value in np.linspace(self.low, self.high, count)]

    def _table(self) -> np.ndarray:
        import matplotlib

        colors = matplotlib.colormaps[self.map_name](np.linspace(0, 1, 256))
        return (colors[:, :3] * 255 + 0.5).astype(np.uint8)


def depth_scale(depths_in_mask: np.ndarray) -> ColorScale:
    """Return the scale that shows the object's depths [m]; everything farther is dark.

    Args:
        depths_in_mask: depths on the object in all views, shape (n,), NaN allowed.
    """
    known = depths_in_mask[~np.isnan(depths_in_mask)]
    # A few outliers must not compress the object into a few colors.
    low, high = np.percentile(known, [1, 99]) if known.size else (0.0, 1.0)
    margin = max(0.05 * (high - low), 0.005 * high)
    return ColorScale("depth [m]", max(0.0, low - margin), high + margin, "viridis_r")


def error_scale(errors_in_mask: np.ndarray) -> ColorScale:
    """Return the symmetric scale of depth errors [mm]."""
    known = np.abs(errors_in_mask[~np.isnan(errors_in_mask)])
    # The colors should show the noise; wrong matches at edges are many times larger.
    limit = float(np.percentile(known, 90)) if known.size else 1.0
    limit = max(limit, 0.1)
    return ColorScale("sensed minus true depth [mm]", -limit, limit, "coolwarm")


def shrink_factor(width: int, max_width: int) -> int:
    """Return the side of the blocks over which `shrink` averages [px]."""
    return -(-width // max_width)


def shrink(image: np.ndarray, max_width: int) -> np.ndarray:
    """Return the image, shape (height, width, 3), averaged over blocks until it is narrow enough."""
    factor = shrink_factor(image.shape[1], max_width)
    height, width = (max(1, size // factor) for size in image.shape[:2])
    if factor == 1 or min(image.shape[:2]) < factor:
        return image
    # Whole rows at a time: a reduction over the short axes takes six times as long.
    rows = image[: height * factor, : width * factor].reshape(height, factor, width * factor, -1)
    strips = rows.sum(axis=1, dtype=np.uint32).reshape(height, width, factor, -1)
    return (strips.sum(axis=2, dtype=np.uint32) / factor**2 + 0.5).astype(np.uint8)


def over_white(image: np.ndarray, mask: np.ndarray | None) -> np.ndarray:
    """Return the object on white, as in training and evaluation; without a mask, the whole image."""
    if mask is None:
        return image
    alpha = mask[..., None].astype(np.float32) / 255
    return (image * alpha + 255 * (1 - alpha) + 0.5).astype(np.uint8)


def data_uri(image: np.ndarray) -> str:
    """Return a JPEG as a data URI; image: sRGB, shape (height, width, 3), uint8."""
    return "data:image/jpeg;base64," + base64.b64encode(encode_jpeg(image)).decode("ascii")
