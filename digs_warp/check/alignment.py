"""Masks that are empty or inverted, and depth that does not lie over the images.

Edges of depth are laid over those of images at all shifts and sizes.

Edges count by how steep they are and by where they point, and all frames together: single ones have too few.
At the rim of things depth is often missing; there the nearest measured pixel stands for it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.camera import Intrinsics
from digs_warp.measure.thumbnails import SmallFrame, green_means, small_frames, thumbnail_step

# Sizes of the depth that are tried, and how far it is shifted to all sides [share of the width].
SIZES, FARTHEST = 1.04 ** np.arange(-6, 7), 0.13
# The second look: sizes around the best one.
CLOSE = 1.01 ** np.arange(-3, 4)
# Photographs are smoothed by this [thumbnail px], and steeper edges than those of this quantile are cut off.
SMOOTH, STEEPEST = 0.7, 0.95
# Depth steps from this share on, and counts in full from twice as much; holes are filled this far [px].
LEAST_STEP, FILLED = 0.05, 3.0
# Frames that tell, evenly spread.
LOOKED_AT = 16
# Thumbnails of fewer rows or columns are left out.
LEAST_SIDE = 16
# Frames in which less of the depth [share] is known are left out.
LEAST_KNOWN = 0.2
# Peaks nearer than this to the highest one belong to it: sizes, and shifts [thumbnail px].
SIZES_AROUND, SHIFTS_AROUND = 2, 5


@dataclass(frozen=True)
class Registration:
    """How depth has to be changed to fit its images.

    Attributes:
        scale: factor on its size, about the middle of the image.
        right: how far it moves then [share of the width].
        down: the same, downward, as a share of the width.
        certainty: by how many standard deviations of all others it fits better than any other change.
        at_rim: whether the best change is the largest that was tried.
    """

    scale: float
    right: float
    down: float
    certainty: float
    at_rim: bool

    def __str__(self) -> str:
        shift = (
            f"{abs(self.right):.1%} of the width to the {'right' if self.right > 0 else 'left'} and "
            f"{abs(self.down):.1%} {'down' if self.down > 0 else 'up'}"
        )
        return f"{'at least ' if self.at_rim else ''}{shift}, at {self.scale:.2f} times its size"

    def depth_camera(self, k: Intrinsics) -> Intrinsics:
        """Return the camera, of the size of ``k``, whose image the depth is, for a color camera ``k``."""
        x, y = k.width / 2, k.height / 2
        cx = x + (k.cx - x - self.right * k.width) / self.scale
        cy = y + (k.cy - y - self.down * k.width) / self.scale
        return Intrinsics(k.width, k.height, k.fx / self.scale, k.fy / self.scale, cx, cy)


def registration(frames: Iterable[tuple[np.ndarray, np.ndarray]]) -> Registration | None:
    """Return how the depth of frames lies against their images; None: it has no edges.

    Args:
        frames: brightness and planar depth [m], NaN where unknown, (height, width) each, as thumbnails.
    """
    large = [each for each in frames if min(each[0].shape) > LEAST_SIDE]
    edges = [(_edges_of_image(image), _edges_of_depth(depth)) for image, depth in large]
    known = [(a, b) for a, b in edges if b is not None and a.any() and b.any()]
    if not known or 2 * len(known) < len(edges):
        return None
    shape = known[0][0].shape[1:]
    known = [each for each in known if each[0].shape[1:] == shape]
    reach = int(FARTHEST * shape[1])
    fits = _fits(known, SIZES, reach)
    size, row, column = (int(i) for i in np.unravel_index(int(fits.argmax()), fits.shape))
    at_rim = size in (0, len(SIZES) - 1) or {row, column} & {0, 2 * reach} != set()
    others = fits.copy()
    around = ((size, SIZES_AROUND), (row, SHIFTS_AROUND), (column, SHIFTS_AROUND))
    others[tuple(slice(max(0, at - by), at + by + 1) for at, by in around)] = -1.0
    certainty = float((fits.max() - others.max()) / fits.std())
    sizes = SIZES[size] * CLOSE
    fits = _fits(known, sizes, reach)
    size, row, column = (int(i) for i in np.unravel_index(int(fits.argmax()), fits.shape))
    right = column + _between(fits[size, row], column) - reach
    down = row + _between(fits[size, :, column], row) - reach
    width = shape[1]
    return Registration(float(sizes[size]), right / width, down / width, certainty, bool(at_rim))


def thumbnail_of(image: np.ndarray, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return brightness and depth of a frame at thumbnail size, as `registration` takes them."""
    step = thumbnail_step(*depth.shape)
    height, width = depth.shape[0] // step * step, depth.shape[1] // step * step
    return green_means(image, step), depth[step // 2 : height : step, step // 2 : width : step]


def _between(values: np.ndarray, at: int) -> float:
    """Return where between its neighbors the peak of three values lies, -0.5 to 0.5 (a parabola)."""
    if not 0 < at < len(values) - 1:
        return 0.0
    before, peak, after = (float(v) for v in values[at - 1 : at + 2])
    bend = before - 2 * peak + after
    return float(np.clip((before - after) / (2 * bend), -0.5, 0.5)) if bend < 0 else 0.0


def _fits(
    edges: Sequence[tuple[np.ndarray, np.ndarray]], sizes: np.ndarray, reach: int
) -> np.ndarray:
    """Return the mean correlation of edges for each size and shift of the depth, (sizes, down, right)."""
    import cv2
    from scipy.fft import irfft2, rfft2

    height, width = edges[0][0].shape[1:]
    padded = (height + 2 * reach, width + 2 * reach)
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    found = np.zeros((len(sizes), 2 * reach + 1, 2 * reach + 1))
    for image, depth in edges:
        there = np.asarray(rfft2(image, padded))
        for number, size in enumerate(sizes):
            turn = np.column_stack([size * np.eye(2), (1 - size) * middle]).astype(np.float32)
            scaled = np.stack([cv2.warpAffine(plane, turn, (width, height)) for plane in depth])
            product = there * np.conj(np.asarray(rfft2(scaled, padded)))
            fit = np.asarray(irfft2(product.sum(axis=0), padded))
            fit = np.roll(fit, (reach, reach), (0, 1))[: 2 * reach + 1, : 2 * reach + 1]
            found[number] += fit / np.sqrt(np.sum(image**2) * np.sum(scaled**2) + 1e-9)
    return found / len(edges)


def _edges_of_image(image: np.ndarray) -> np.ndarray:
    """Return the planes of `_planes` of a thumbnail's brightness."""
    import cv2

    down, across = np.gradient(cv2.GaussianBlur(image.astype(np.float32), (0, 0), SMOOTH))
    return _planes(across, down, float(np.quantile(np.hypot(across, down), STEEPEST)))


def _edges_of_depth(depth: np.ndarray) -> np.ndarray | None:
    """Return the same of a depth map, where it steps; None: little of it is known."""
    import cv2

    unknown = ~np.isfinite(depth)
    if unknown.mean() > 1 - LEAST_KNOWN:
        return None
    away, labels = cv2.distanceTransformWithLabels(
        unknown.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE, labelType=cv2.DIST_LABEL_PIXEL
    )
    labels = np.asarray(labels, np.intp)
    nearest = np.zeros(labels.max() + 1, np.float32)
    nearest[labels[~unknown]] = np.log(depth[~unknown])
    down, across = np.gradient(nearest[labels])
    steps = (np.hypot(across, down) > LEAST_STEP) & (away <= FILLED)
    return _planes(across * steps, down * steps, 2 * LEAST_STEP)


def _planes(across: np.ndarray, down: np.ndarray, most: float) -> np.ndarray:
    """Return steepness, less its mean, and steepness by direction, (3, height, width), float32.

    The direction counts twice, so that both sides of an edge are the same: (cos 2a, sin 2a).
    """
    steepness = np.hypot(across, down)
    share = np.minimum(steepness, most) / np.maximum(steepness * most, 1e-12)
    x, y = across * share, down * share
    length = np.maximum(np.hypot(x, y), 1e-12)
    planes = np.stack([length - length.mean(), (x * x - y * y) / length, 2 * x * y / length])
    return planes.astype(np.float32)


# The depth of a Kinect or its like is so much larger than its color image shows it, unless it is registered.
KINECT_SCALE, KINECT_SPREAD = 525 / 585, 0.03
KINECT = (
    " Such is the depth of a Kinect, Xtion or PrimeSense that was recorded without registration: "
    "--register-depth kinect."
)

# Masks that are looked at, evenly spread, for whether they mark anything.
MASKS = 10


def depth_elsewhere(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find depth that fits the images better after a shift by this [of the width], or at another size."""
    whole = [replace(frame, alone=False) for frame in evidence.capture.frames]
    frames = small_frames(whole, evenly(range(len(whole)), LOOKED_AT)).values()
    found = registration((frame.green, frame.depth) for frame in frames)
    if found is None or found.certainty < limits.REGISTRATION_CERTAINTY:
        return None
    size = abs(np.log(found.scale))
    if np.hypot(found.right, found.down) < least and size < limits.REGISTRATION_SIZE:
        return None
    return {
        "move": found,
        "kinect": KINECT if abs(found.scale - KINECT_SCALE) < KINECT_SPREAD else "",
    }


def masks_of_nothing(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find masks that mark less than this share of the image, or almost no pixel (median)."""
    frames = [frame for frame in evidence.capture.frames if frame.has(Layer.MASK)]
    if not (frames and evidence.uses_masks):
        return None
    some = frames[:: -(-len(frames) // MASKS)]
    marked = [np.count_nonzero(frame.load_mask() > 127) for frame in some]
    size = some[0].camera.intrinsics.width * some[0].camera.intrinsics.height
    pixels = float(np.median(marked))
    is_little = pixels < min(limits.LEAST_MASK, least * size)
    return {"pixels": f"{pixels:,.0f} of {size:,}"} if is_little else None


def masks_inverted(evidence: Evidence, share: float) -> dict[str, Any] | None:
    """Find masks that mark the surroundings: more than this share of them."""
    frames = [frame for frame in evidence.frames.values() if frame.mask is not None]
    inverted = sum(map(_is_inverted, frames)) if evidence.uses_masks else 0
    return {"inverted": inverted, "count": len(frames)} if inverted > share * len(frames) else None


def _is_inverted(frame: SmallFrame) -> bool:
    mask = frame.mask
    assert mask is not None
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    marked, left_out = (frame.depth[where & np.isfinite(frame.depth)] for where in (mask, ~mask))
    covers = border.mean() >= limits.INVERTED_BORDER and (~mask).mean() >= limits.INVERTED_HOLE
    if not (covers and marked.size and left_out.size):
        return False
    return bool(np.median(left_out) < np.median(marked))
