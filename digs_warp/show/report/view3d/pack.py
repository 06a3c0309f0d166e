"""Gaussians for a page: five unsigned 32-bit words each, little-endian, then their harmonics.

    word 0, 1, 2   bits 0-23: x, y or z in steps from `low`; bits 24-31: log scale of that local axis
    word 3         bits 0-9, 10-19, 20-29: the three smaller components of the unit quaternion, from
                   -sqrt(1/2) to sqrt(1/2), in the order x, y, z, w; bits 30-31: which is the largest
    word 4         red, green, blue, opacity, 8 bits each, red lowest: the mean color over all directions

The harmonics above band 0, signed bytes in steps of `harmonic_step`, follow the words of all Gaussians: red,
green and blue of each coefficient. `unpack.js` is the reader.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from digs_warp.data.gaussians import Gaussians, ScreenFilter
from digs_warp.data.images import to_uint8
from digs_warp.formats.splats.rows import (
    codes_from_logits,
    finite_rows,
    smallest_three,
    unit_quats,
)
from digs_warp.geometry.sh import C0

WORDS = 5

# Most bytes of a page that the Gaussians take, as base64 (4 characters for 3 bytes).
MOST_BYTES = 4_000_000

POSITION_STEPS = 2**24 - 1
SCALE_STEPS = 2**8 - 1
QUAT_STEPS = 2**10 - 1
HARMONIC_STEPS = 2**7 - 1

# A log scale below this is drawn as this: exp(-18) m is far below what any camera resolves.
LEAST_LOG_SCALE = -18.0
# Larger harmonics than this share are clipped: a few would make the steps of all coarse.
HARMONIC_PERCENT = 99.9


@dataclass(frozen=True, eq=False)
class PackedSplats:
    """What a page holds.

    Attributes:
        words: shape (n, WORDS), uint32.
        low: the corner of the box of the centers [m], shape (3,), and ``step``: one step [m], shape (3,).
        log_low, log_step: the same of the log scales.
        harmonics: shape (n, K - 1, 3), int8, and ``harmonic_step``: one step.
        total: number of Gaussians that these were chosen from.
        screen_filter: what they are drawn with.
    """

    words: np.ndarray
    low: np.ndarray
    step: np.ndarray
    log_low: float
    log_step: float
    harmonics: np.ndarray
    harmonic_step: float
    total: int
    screen_filter: ScreenFilter

    def __len__(self) -> int:
        return len(self.words)

    def to_bytes(self) -> bytes:
        """Return words and harmonics."""
        return self.words.tobytes() + self.harmonics.tobytes()

    def about(self) -> dict[str, Any]:
        """Return what the reader has to know of the bytes."""
        return {
            "count": len(self),
            "low": self.low.tolist(),
            "step": self.step.tolist(),
            "logLow": self.log_low,
            "logStep": self.log_step,
            "harmonicStep": self.harmonic_step,
            "dilation": self.screen_filter.dilation,
            "antialias": self.screen_filter.antialias,
        }


def pack(gaussians: Gaussians, most_bytes: int = MOST_BYTES) -> PackedSplats:
    """Return Gaussians that take at most so many bytes as base64; there is at least one.

    Where there is no room, the highest harmonics go first; then the Gaussians that cover the least.
    """
    total = len(gaussians)
    gaussians = gaussians.select(finite_rows(gaussians))
    room = most_bytes * 3 // 4
    degree = gaussians.sh_degree
    while degree and len(gaussians) * _splat_bytes(degree) > room:
        degree -= 1
    gaussians = gaussians.select(_most_visible(gaussians, room // _splat_bytes(degree)))
    means = gaussians.means.astype(np.float64)
    low, step = _range(means, POSITION_STEPS)
    logs = np.maximum(gaussians.log_scales.astype(np.float64), LEAST_LOG_SCALE)
    log_low, log_step = (float(value[0]) for value in _range(logs.reshape(-1, 1), SCALE_STEPS))
    words = np.zeros((len(gaussians), WORDS), np.uint32)
    places = np.rint((means - low) / step).astype(np.uint32)
    words[:, :3] = places | np.rint((logs - log_low) / log_step).astype(np.uint32) << 24
    words[:, 3] = _packed_quats(gaussians.quats)
    words[:, 4] = _packed_colors(gaussians)
    harmonics, harmonic_step = _packed_harmonics(gaussians.sh[:, 1 : (degree + 1) ** 2])
    return PackedSplats(
        *(words, low, step, log_low, log_step, harmonics, harmonic_step, total),
        gaussians.screen_filter,
    )


def _splat_bytes(degree: int) -> int:
    return 4 * WORDS + 3 * ((degree + 1) ** 2 - 1)


def _packed_harmonics(sh: np.ndarray) -> tuple[np.ndarray, float]:
    """Return coefficients as steps, int8, and the size of a step, above 0."""
    largest = float(np.percentile(np.abs(sh), HARMONIC_PERCENT)) if sh.size else 0.0
    step = max(largest / HARMONIC_STEPS, 1e-9)
    steps = np.rint(np.clip(sh / np.float32(step), -HARMONIC_STEPS, HARMONIC_STEPS))
    return steps.astype(np.int8), step


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
    largest, others = smallest_three(unit_quats(quats))
    steps = np.rint((others * np.sqrt(2.0) + 1.0) / 2.0 * QUAT_STEPS).astype(np.uint32)
    return steps[:, 0] | steps[:, 1] << 10 | steps[:, 2] << 20 | largest.astype(np.uint32) << 30


def _packed_colors(gaussians: Gaussians) -> np.ndarray:
    """Return red, green, blue and opacity in a word, the last highest."""
    codes = np.empty((len(gaussians), 4), np.uint8)
    codes[:, :3] = to_uint8(0.5 + C0 * gaussians.sh[:, 0])
    codes[:, 3] = codes_from_logits(gaussians.opacity_logits)
    return codes.view("<u4")[:, 0]
