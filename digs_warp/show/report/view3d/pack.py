"""Gaussians in 20 bytes each, for a page: five unsigned 32-bit words, little-endian.

    word 0, 1, 2   bits 0-23: x, y or z in steps from `low`; bits 24-31: log scale of that local axis
    word 3         bits 0-9, 10-19, 20-29: the three smaller components of the unit quaternion, from
                   -sqrt(1/2) to sqrt(1/2), in the order x, y, z, w; bits 30-31: which is the largest
    word 4         red, green, blue, opacity, 8 bits each, red lowest

The color is that of band 0: the mean over all directions, without shine. `unpack.js` is the reader.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.gaussians import FIELDS, Gaussians, ScreenFilter
from digs_warp.geometry.sh import C0

WORDS = 5

# Most bytes of a page that the Gaussians take, as base64 (4 characters for 3 bytes).
MOST_BYTES = 4_000_000
MOST_SPLATS = MOST_BYTES * 3 // 4 // (4 * WORDS)

POSITION_STEPS = 2**24 - 1
SCALE_STEPS = 2**8 - 1
QUAT_STEPS = 2**10 - 1

# A log scale below this is drawn as this: exp(-18) m is far below what any camera resolves.
LEAST_LOG_SCALE = -18.0


@dataclass(frozen=True, eq=False)
class PackedSplats:
    """What a page holds.

    Attributes:
        words: shape (n, WORDS), uint32.
        low: the corner of the box of the centers [m], shape (3,), and ``step``: one step [m], shape (3,).
        log_low, log_step: the same of the log scales.
        total: number of Gaussians that these were chosen from.
        screen_filter: what they are drawn with.
    """

    words: np.ndarray
    low: np.ndarray
    step: np.ndarray
    log_low: float
    log_step: float
    total: int
    screen_filter: ScreenFilter

    def __len__(self) -> int:
        return len(self.words)


def pack(gaussians: Gaussians, most: int = MOST_SPLATS) -> PackedSplats:
    """Return at most ``most`` Gaussians, those that cover the most; there is at least one."""
    total = len(gaussians)
    gaussians = _finite(gaussians)
    gaussians = gaussians.select(_most_visible(gaussians, most))
    means = gaussians.means.astype(np.float64)
    low, step = _range(means, POSITION_STEPS)
    logs = np.maximum(gaussians.log_scales.astype(np.float64), LEAST_LOG_SCALE)
    log_low, log_step = (float(value[0]) for value in _range(logs.reshape(-1, 1), SCALE_STEPS))
    words = np.zeros((len(gaussians), WORDS), np.uint32)
    places = np.rint((means - low) / step).astype(np.uint32)
    words[:, :3] = places | np.rint((logs - log_low) / log_step).astype(np.uint32) << 24
    words[:, 3] = _packed_quats(gaussians.quats)
    words[:, 4] = _packed_colors(gaussians)
    return PackedSplats(words, low, step, log_low, log_step, total, gaussians.screen_filter)


def _finite(gaussians: Gaussians) -> Gaussians:
    keep = np.ones(len(gaussians), bool)
    for name in FIELDS:
        keep &= np.isfinite(getattr(gaussians, name).reshape(len(gaussians), -1)).all(axis=1)
    return gaussians if keep.all() else gaussians.select(keep)


def _most_visible(gaussians: Gaussians, most: int) -> np.ndarray:
    """Return the indices of those with the largest product of opacity and area, in their order."""
    if len(gaussians) <= most:
        return np.arange(len(gaussians))
    widest = np.sort(gaussians.log_scales.astype(np.float64), axis=1)[:, 1:].sum(axis=1)
    weight = np.log(np.maximum(gaussians.opacities.astype(np.float64), 1e-12)) + widest
    return np.sort(np.argpartition(-weight, most - 1)[:most])


def _range(values: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest of each column and a step, above 0, that reaches the highest in ``steps``."""
    low, high = values.min(axis=0), values.max(axis=0)
    return low, np.maximum((high - low) / steps, 1e-12)


def _packed_quats(quats: np.ndarray) -> np.ndarray:
    q = quats.astype(np.float64)
    length = np.linalg.norm(q, axis=1, keepdims=True)
    q = np.where(length > 0, q / np.where(length > 0, length, 1.0), [0.0, 0.0, 0.0, 1.0])
    largest = np.abs(q).argmax(axis=1)
    q *= np.where(np.take_along_axis(q, largest[:, None], axis=1) < 0, -1.0, 1.0)
    others = q[np.arange(4) != largest[:, None]].reshape(-1, 3)
    steps = np.rint((others * np.sqrt(2.0) + 1.0) / 2.0 * QUAT_STEPS).astype(np.uint32)
    return steps[:, 0] | steps[:, 1] << 10 | steps[:, 2] << 20 | largest.astype(np.uint32) << 30


def _packed_colors(gaussians: Gaussians) -> np.ndarray:
    rgb = 0.5 + C0 * gaussians.sh[:, 0].astype(np.float64)
    values = np.concatenate([rgb, gaussians.opacities[:, None]], axis=1)
    steps = np.rint(np.clip(values, 0.0, 1.0) * 255).astype(np.uint32)
    return steps[:, 0] | steps[:, 1] << 8 | steps[:, 2] << 16 | steps[:, 3] << 24
