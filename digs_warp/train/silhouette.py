"""The object's own color at its silhouette, where a pixel of the photograph mixes it with the room.

A pixel that the object covers by a share m shows  p = m c + (1 - m) r : c is the object's color, r that of
the room behind it. The target of the training puts m p over the background of the step: the color (1 - m) r
would come along and teach the rim of the object the color of the room. So c replaces p before the training.
r is known from pixels beside the object, and c should be like that of the object beside the rim, c':

    minimize  (p - m c - (1 - m) r)^2 + k (c - c')^2   =>   c = (m (p - (1 - m) r) + k c') / (m^2 + k)

c stays near the range of the object's colors nearby: masks are not exact, and a wrong m must not invent
colors.
"""

import numpy as np

# How far the colors of object and room are looked for [px]; a soft rim is one or two pixels wide.
REACH = 3

# k: how much the neighbors count against the mixture, whose share is known to a few steps of a coarse mask.
NEIGHBORS = 0.1

# How far c may leave the range of the object's colors nearby, in steps of 8 bits.
MARGIN = 25.0

# Pixels at once: bounds the memory where a mask is soft over large areas.
_PIECE = 16_384

_STEPS = np.arange(-REACH, REACH + 1)
_DOWN, _ACROSS = (grid.ravel() for grid in np.meshgrid(_STEPS, _STEPS, indexing="ij"))
_NEAR = np.exp(-(_DOWN**2 + _ACROSS**2) / 4.0).astype(np.float32)


def without_surround(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the photograph with the object's color where the mask is neither 0 nor full.

    Args:
        image: sRGB, (height, width, 3), uint8.
        mask: coverage 0..255, (height, width), uint8.

    Returns:
        A new image, or ``image`` itself where the mask has no such pixel. A pixel without the object in full
        nearby keeps its color.
    """
    rows, columns = np.nonzero((mask > 0) & (mask < 255))
    if not len(rows):
        return image
    cleaned = image.copy()
    for first in range(0, len(rows), _PIECE):
        at = (rows[first : first + _PIECE], columns[first : first + _PIECE])
        cleaned[at] = _object_colors(image, mask, *at)
    return cleaned


def _object_colors(
    image: np.ndarray, mask: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> np.ndarray:
    """Return the object's color at pixels, shape (n, 3), uint8."""
    height, width = mask.shape
    down, across = rows[:, None] + _DOWN, columns[:, None] + _ACROSS
    inside = (down >= 0) & (down < height) & (across >= 0) & (across < width)
    there = (np.clip(down, 0, height - 1), np.clip(across, 0, width - 1))
    colors, cover = image[there].astype(np.float32), mask[there]
    on_object, on_room = inside & (cover == 255), inside & (cover == 0)
    photo = image[rows, columns].astype(np.float32)
    share = mask[rows, columns].astype(np.float32)[:, None] / 255.0
    near, has_object = _mean(colors, on_object)
    room, has_room = _mean(colors, on_room)
    unmixed = share * (photo - (1.0 - share) * room) + NEIGHBORS * near
    found = np.where(has_room, unmixed / (share**2 + NEIGHBORS), near)
    planes = np.ascontiguousarray(np.moveaxis(colors, -1, 0))  # extremes along rows are far faster
    least = np.where(on_object, planes, np.float32(255.0)).min(axis=-1).T
    most = np.where(on_object, planes, np.float32(0.0)).max(axis=-1).T
    found = np.clip(np.clip(found, least - MARGIN, most + MARGIN), 0.0, 255.0)
    return np.rint(np.where(has_object, found, photo)).astype(np.uint8)


def _mean(colors: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of the chosen colors, the nearest counting most, (n, 3), and whether there is one."""
    weights = np.where(chosen, _NEAR, np.float32(0.0))
    total = weights.sum(axis=1, keepdims=True)
    mean = np.einsum("nk,nkc->nc", weights, colors) / np.maximum(total, 1e-9)
    return mean, total > 0
