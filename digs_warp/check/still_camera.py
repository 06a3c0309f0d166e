"""A camera that stands still while something changes before it: nothing is then seen from two sides.

Where the camera moves, edges move in the image. Where it stands, they stay, even half a recording later.
Frames that repeat are another finding (`digs_warp.check.repeats`); here something came or went.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.check.finding import Finding
from digs_warp.check.thumbnails import green_means, thumbnails
from digs_warp.data.capture import Capture
from digs_warp.data.evenly import evenly
from digs_warp.data.frame import Frame

# This many frames, evenly spread, are compared with the next of them and with those half a recording later,
# as thumbnails of this width [px] or less.
FRAMES, WIDTH = 24, 160

# Pixels tell whether the camera moves where they differ by this much [of 255] from those around them; they
# have stayed where they changed by less than this share of it, and by less than noise does.
EDGE, STAYED, NOISE = 16.0, 0.25, 6.0

# The share of edges that stay where the camera stands; cameras that move keep a third of it.
AT_REST = 0.7

# A pixel changed if it is brighter or darker by this [of 255] than all around it in the other frame; this
# share of the image is noticed.
OTHER, CHANGED = 20.0, 0.005

# A pair of frames tells something only if it has this many edges.
FEWEST = 100

# Cameras that turned this far [degrees] by their poses did not stand: an object on a turntable did.
TURNED = 10.0


@dataclass(frozen=True)
class Stillness:
    """Two frames.

    Attributes:
        stayed: share of the edges that are where they were, 0 to 1.
        changed: share of the pixels that show something else, 0 to 1.
    """

    stayed: float
    changed: float


def still_camera(capture: Capture) -> list[Finding]:
    """Return a finding if the camera stands still in most frames and something changes; needs images only.

    Raises:
        DigsError: a file that cannot be read.
    """
    if capture.knows_poses and _turned(capture.frames):
        return []
    looks = thumbnails(evenly(capture.frames, FRAMES), thumbnail)
    count = len(looks)
    pairs = {tuple(sorted((i, (i + k) % count))) for i in range(count) for k in (1, count // 2)}
    found = [stillness(looks[a], looks[b]) for a, b in sorted(pairs) if a != b]
    told = [each for each in found if each is not None]
    if len(told) < 2 or np.median([each.stayed for each in told]) <= AT_REST:
        return []
    changed = float(np.median([each.changed for each in told]))
    if changed <= CHANGED:
        return []
    what = (
        f"The camera stands still, and {changed:.1%} of its image change from frame to frame: all is seen "
        "from one side, and not the same."
    )
    mend = "Record something that does not change, and walk around it."
    return [Finding("still camera", what, mend)]


def stillness(first: np.ndarray, second: np.ndarray) -> Stillness | None:
    """Compare two thumbnails, (height, width), 0 to 255; None: of different sizes, or too plain to tell."""
    if first.shape != second.shape:
        return None
    # The exposure may differ.
    second = second * (np.median(first) / max(float(np.median(second)), 1.0))
    darkest, brightest = _around(second)
    least, most = _around(first)
    contrast = np.minimum(most - least, brightest - darkest)
    edges = contrast > EDGE
    if np.count_nonzero(edges) < FEWEST:
        return None
    stayed = np.abs(first - second) < np.maximum(STAYED * contrast, NOISE)
    other = (first < darkest - OTHER) | (first > brightest + OTHER)
    return Stillness(float(stayed[edges].mean()), float(other.mean()))


def _turned(frames: Sequence[Frame]) -> bool:
    axes = np.array([frame.camera.world_from_cam[:3, 2] for frame in frames])
    return bool((axes @ axes[0] < np.cos(np.deg2rad(TURNED))).any())


def _around(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest value within two pixels, (height, width) each."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(image, 2, mode="edge"), (5, 5))
    return windows.min(axis=(2, 3)), windows.max(axis=(2, 3))


def thumbnail(image: np.ndarray) -> np.ndarray:
    """Return the green channel of an image in means over squares of pixels, (height, width)."""
    return green_means(image, -(-image.shape[1] // WIDTH))
