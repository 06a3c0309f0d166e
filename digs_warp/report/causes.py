"""Why depth pixels are missing or wrong, in colors: the cause images of a simulated capture."""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer

# Nearly white where the depth is right: only what went wrong has a color.
OK_COLOR = np.array([238, 240, 243], dtype=np.uint8)

# Twenty colors that can be told apart, in pairs; neighboring causes take colors of different pairs.
COLOR_MAP = "tab20"
PAIR_STEP = 7


def paint_causes(causes: np.ndarray) -> np.ndarray:
    """Return a color per cause, shape (height, width, 3), uint8; causes: (height, width), uint8."""
    import matplotlib

    colors = matplotlib.colormaps[COLOR_MAP]
    table = (colors((PAIR_STEP * np.arange(256)) % colors.N)[:, :3] * 255 + 0.5).astype(np.uint8)
    table[0] = OK_COLOR
    return table[causes]


def describe_causes(capture: Capture, frames: Sequence[Frame]) -> list[tuple[str, str]]:
    """Return (CSS color, "cause, share of pixels") of every cause in the frames, the largest first."""
    counts = np.zeros(256, dtype=np.int64)
    for frame in frames:
        if frame.has(Layer.CAUSE):
            counts += np.bincount(frame.load_cause().ravel(), minlength=256)
    labels = capture.about.cause_labels or {}
    described = []
    for code in np.argsort(-counts, kind="stable")[: np.count_nonzero(counts)]:
        r, g, b = paint_causes(np.array([[code]]))[0, 0]
        name = labels.get(int(code), f"cause {code}").replace("_", " ")
        described.append((f"rgb({r} {g} {b})", f"{name} {counts[code] / counts.sum():.1%}"))
    return described
