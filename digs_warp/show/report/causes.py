"""Why depth pixels are missing or wrong, in colors and patterns: the cause images of a simulated capture."""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.show.report.pictures import data_uri

# Nearly white where the depth is right: only what went wrong has a color.
OK_COLOR = np.array([238, 240, 243], dtype=np.uint8)

# Twenty colors that can be told apart, in pairs; neighboring causes take colors of different pairs.
COLOR_MAP = "tab20"
PAIR_STEP = 7

# Patterns tell causes apart for people who do not see the colors: which places of a tile are drawn darker.
TILE = 8
DARKER = 0.4
_ROW, _COLUMN = np.mgrid[:TILE, :TILE]
_RISING, _FALLING = (_ROW + _COLUMN) % TILE < 2, (_ROW - _COLUMN) % TILE < 2
_LEVEL, _UPRIGHT, _NONE = _ROW % 4 < 1, _COLUMN % 4 < 1, np.zeros((TILE, TILE), dtype=bool)
_DOTS = (_ROW % 4 < 2) & (_COLUMN % 4 < 2)
PATTERNS = np.array(
    [_RISING, _LEVEL, _DOTS, _FALLING, _UPRIGHT, _LEVEL | _UPRIGHT, _RISING | _FALLING, _NONE]
)

# A smaller share of the pixels is not told exactly.
LEAST_SHARE = 0.001

SWATCH_HEIGHT, SWATCH_WIDTH = 2 * TILE, 3 * TILE


def paint_causes(causes: np.ndarray, step: int = 1) -> np.ndarray:
    """Return a color and a pattern per cause, shape (height, width, 3), uint8.

    Args:
        causes: codes, (height, width), uint8; 0: the depth is right.
        step: side of a place of the pattern [px]; by how much the picture will be reduced.
    """
    import matplotlib

    colors = matplotlib.colormaps[COLOR_MAP]
    table = colors((PAIR_STEP * np.arange(256)) % colors.N)[:, :3]
    table = (np.stack([table, DARKER * table]) * 255 + 0.5).astype(np.uint8)
    table[:, 0] = OK_COLOR
    rows, columns = ((np.arange(size) // step) % TILE for size in causes.shape)
    kind = (causes.astype(np.int64) - 1) % len(PATTERNS)
    darker = PATTERNS[kind, rows[:, None], columns[None, :]]
    return table[darker.astype(np.int64), causes]


def describe_causes(capture: Capture, frames: Sequence[Frame]) -> list[tuple[str, str]]:
    """Return (data URI of a swatch, "cause, share of pixels: meaning") of every cause in the frames.

    The largest comes first.
    """
    counts = np.zeros(256, dtype=np.int64)
    for frame in frames:
        if frame.has(Layer.CAUSE):
            counts += np.bincount(frame.load_cause().ravel(), minlength=256)
    described = []
    for code in np.argsort(-counts, kind="stable")[: np.count_nonzero(counts)]:
        swatch = paint_causes(np.full((SWATCH_HEIGHT, SWATCH_WIDTH), code, np.uint8))
        share = counts[code] / counts.sum()
        percent = f"{share:.1%}" if share >= LEAST_SHARE else f"under {LEAST_SHARE:.1%}"
        words = f"{_label(capture, code).replace('_', ' ')} {percent}{_meaning(capture, code)}"
        described.append((data_uri(swatch), words))
    return described


def _meaning(capture: Capture, code: int) -> str:
    """Return what a cause of our simulator means, after a colon; nothing for causes of other programs."""
    from digs_warp.sim.sensor.frame import Cause

    name = _label(capture, code).upper()
    return f": {Cause[name].meaning}" if name in Cause.__members__ else ""


def _label(capture: Capture, code: int) -> str:
    labels = capture.about.cause_labels or {}
    return labels.get(int(code), f"cause {code}")
