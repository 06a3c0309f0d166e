"""Masks without a network: segments the foreground by its depth, with borders from the photograph.

The surface that the object stands on, or the wall behind it, is the plane that most depth pixels lie in. What
is nearer falls into pieces at jumps of depth, and the piece in the middle of the image is the object. Depth
is missing or wrong at the borders, where colors are sharp: there GrabCut decides (Rother, Kolmogorov and
Blake, SIGGRAPH 2004).
"""

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.masks.planes import before_planes, border_pixels, middle_weights

# The cut runs on an image of at most this side [px]: its time grows with the pixels, its exactness little.
CUT_SIZE = 720
CUT_ROUNDS = 3

# Width, as a share of the image's longer side, of the band at the depth's borders in which colors decide.
BAND = 0.012

# Unknown depth takes its neighbor's value over this distance, as a share of the image's longer side.
GAP = 0.015

# Neighbors belong together when their depths differ by less than this share.
LARGEST_STEP = 0.05

# Pieces beside the best one are kept from this share of its score on, if they are about as far away.
PIECE_SHARE = 0.1
PIECE_DEPTH_RATIO = 1.3

# What the border of the image cuts is rarely the object: its score falls by this, per share of the border.
BORDER_PENALTY = 100.0

OBJECT, SURROUND = 255, 0


def mask_from_depth(image: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return the mask of the foreground in the middle of the image; empty if there is none.

    Args:
        image: sRGB, shape (height, width, 3), uint8.
        depth: planar depth [m], shape (height, width), NaN where unknown.

    Returns:
        Shape (height, width), uint8, 0 to 255.
    """
    import cv2

    height, width = depth.shape
    check_shape("image", image, (height, width, 3))
    factor = min(1.0, CUT_SIZE / max(height, width))
    size = max(1, round(width * factor)), max(1, round(height * factor))
    small_depth = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST)
    gap, known = round(GAP * max(size)), np.isfinite(small_depth)
    measured = object_by_depth(with_gaps_filled(small_depth, gap)) & known
    if not measured.any():
        return np.full((height, width), SURROUND, np.uint8)
    near = without_enclosed_holes(closed(measured, gap) & (measured | ~known), known)
    far = closed(known & ~measured, gap) & ~near
    small_image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    cut = refine_by_color(small_image, near, far)
    # Bilinear enlargement gives the border the soft edge of a network's mask.
    return cv2.resize(np.where(cut, OBJECT, SURROUND).astype(np.uint8), (width, height))


def object_by_depth(depth: np.ndarray) -> np.ndarray:
    """Return the pixels of the piece in the middle that stands before plane and surround, (h, w) bool."""
    in_front = before_planes(depth)
    labels = connected_pieces(depth, in_front)
    if not in_front.any():
        return in_front
    scores = np.bincount(labels[in_front], weights=middle_weights(depth.shape)[in_front])
    border = _border_share(labels, in_front, len(scores))
    scores /= 1.0 + BORDER_PENALTY * border
    best = int(np.argmax(scores))
    distance = np.median(depth[in_front & (labels == best)])
    kept = [
        piece
        for piece in np.flatnonzero(scores >= PIECE_SHARE * scores[best])
        if _ratio(np.median(depth[in_front & (labels == piece)]), distance) < PIECE_DEPTH_RATIO
        and (border[piece] == 0 or border[best] > 0)
    ]
    return in_front & np.isin(labels, kept)


def connected_pieces(depth: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the number of the piece that each pixel belongs to; pieces end at jumps of depth.

    Args:
        depth: shape (height, width); finite where ``wanted``.
        wanted: shape (height, width), bool; each other pixel is a separate piece.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = depth.size
    index = np.arange(count).reshape(depth.shape)
    logs = np.log(np.where(wanted, depth, 1.0))
    links = []
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        together = wanted[a] & wanted[b] & (np.abs(logs[a] - logs[b]) < LARGEST_STEP)
        links.append(np.stack([index[a][together], index[b][together]]))
    first, second = np.concatenate(links, axis=1)
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    return connected_components(graph, directed=False)[1].reshape(depth.shape)


def with_gaps_filled(depth: np.ndarray, radius: int) -> np.ndarray:
    """Return the depth with unknown pixels given the value of the nearest known one within ``radius`` px."""
    from scipy.ndimage import distance_transform_edt

    unknown = ~np.isfinite(depth)
    if unknown.all():
        return depth
    found = distance_transform_edt(unknown, return_indices=True)
    assert found is not None  # only when told to write elsewhere
    distance, (v, u) = found
    return np.where(distance <= radius, depth[v, u], depth)


def closed(mask: np.ndarray, radius: int) -> np.ndarray:
    """Return the mask with gaps up to 2 ``radius`` px filled; its outline stays (morphological closing)."""
    import cv2

    padded = np.pad(mask.astype(np.uint8), radius)  # the image border must not pull the mask
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    filled = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, kernel) > 0
    return filled[radius : radius + mask.shape[0], radius : radius + mask.shape[1]]


def without_enclosed_holes(near: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return ``near`` with its holes filled where no depth says that one sees through."""
    import cv2

    _, labels = cv2.connectedComponents((~near).astype(np.uint8), connectivity=4)
    open_labels = np.unique(
        np.concatenate([labels[known], labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    )
    return near | ~np.isin(labels, open_labels)


def main_pieces(mask: np.ndarray) -> np.ndarray:
    """Return the largest connected piece and all that are not much smaller; strays are left out."""
    import cv2

    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count < 2:
        return mask
    areas = stats[1:, cv2.CC_STAT_AREA]
    kept = 1 + np.flatnonzero(areas >= PIECE_SHARE * areas.max())
    return np.isin(labels, kept)


def refine_by_color(image: np.ndarray, near: np.ndarray, far: np.ndarray) -> np.ndarray:
    """Return the object, (height, width) bool: near and far stay what they are away from their borders."""
    import cv2

    radius = max(1, round(BAND * max(near.shape)))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    # The image border is no border of the object.
    sure_object = cv2.erode(near.astype(np.uint8), kernel, borderValue=1)
    sure_surround = cv2.erode(far.astype(np.uint8), kernel, borderValue=1)
    if not (sure_object.any() and sure_surround.any()):  # nothing to learn colors from
        return near
    labels = np.where(near, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[sure_object > 0] = cv2.GC_FGD
    labels[sure_surround > 0] = cv2.GC_BGD
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.setRNGSeed(0)  # of this thread: the same image gives the same mask
    bgr = np.ascontiguousarray(image[..., ::-1])
    no_box = (0, 0, 0, 0)
    cv2.grabCut(bgr, labels, no_box, *models, CUT_ROUNDS, cv2.GC_INIT_WITH_MASK)
    return main_pieces((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD))


def _border_share(labels: np.ndarray, wanted: np.ndarray, pieces: int) -> np.ndarray:
    """Return which share of the image's border each piece takes, (pieces,)."""
    along = border_pixels(wanted)
    return np.bincount(border_pixels(labels)[along], minlength=pieces) / len(along)


def _ratio(a: float, b: float) -> float:
    return max(a, b) / min(a, b)
