"""How it was recorded: too few views, repeated frames, exposure, what moves along."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence, brightness_ratio, exposure_change, ratio_of
from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly, spread
from digs_warp.geometry.rigid import turn_degrees
from digs_warp.masks.no_scene import black_border
from digs_warp.measure.thumbnails import green_means, small_frames, thumbnail_step, thumbnails
from digs_warp.poses.photo_matches import matches_of_steps
from digs_warp.words import counted

# Photographs that are looked at, evenly spread; the exposure is compared with that of the next frame.
PHOTOGRAPHS = 30

# Steps between frames that are looked at for repeats, evenly spread, and columns of their thumbnails.
MOST_STEPS, WIDTH = 300, 40

# Photographs that are compared to see whether the camera moved, and the side of a compared part [thumbnail
# px]. A part stands still if it looks the same in this share of them.
STILLS, PART, MOSTLY = 8, 8, 0.75
# The outermost thumbnail pixels do not count: many cameras have a dark column or row there, always the same.
RIM = 1


@dataclass(frozen=True)
class Stillness:
    """What photographs far apart have in common, place by place.

    Attributes:
        parts: of the image that show something: outside of the masks, where there are masks.
        still: share of these that show the same in nearly all photographs, 0 to 1.
        changing: how many parts, in masks or not, do not.
        fixed: where details are the same in nearly all, (height, width) of the thumbnails, bool.
    """

    parts: int
    still: float
    changing: int
    fixed: np.ndarray

    @property
    def is_still(self) -> bool:
        """Whether the camera stood still while something turned or moved before it."""
        seen = min(self.parts, self.changing) >= limits.FEWEST_PARTS
        return seen and self.still > limits.STILL_SHARE

    @property
    def changes(self) -> bool:
        """Whether more than noise, a lamp or somebody who passes changes."""
        return self.changing > limits.LEAST_CHANGE * self.parts

    @property
    def is_bare(self) -> bool:
        """Whether nothing is seen around the object."""
        return self.parts < limits.FEWEST_PARTS


def stillness(frames: Sequence[Frame]) -> Stillness | None:
    """Return what photographs have in common; None if they are few, or of several sizes."""
    chosen = evenly(frames, STILLS)
    sizes = {(f.camera.intrinsics.width, f.camera.intrinsics.height) for f in chosen}
    if len(chosen) < 3 or len(sizes) > 1:
        return None
    shape = sizes.pop()[::-1]
    step = thumbnail_step(*shape)
    parts = np.stack(thumbnails(chosen, lambda image: _parts(green_means(image, step))))
    contrast = parts.std(axis=2)
    shapes = (parts - parts.mean(axis=2, keepdims=True)) / np.maximum(contrast, 1e-6)[..., None]
    alike = np.einsum("ijk,jk->ij", shapes[1:], shapes[0]) / parts.shape[2]
    same = np.quantile(alike, 1 - MOSTLY, axis=0) > limits.SAME_PART
    shows = contrast.max(axis=0) > limits.PLAIN_PART
    around = shows
    if all(frame.has(Layer.MASK) for frame in chosen):
        masks = [np.repeat(frame.load_mask()[..., None], 3, axis=2) for frame in chosen]
        around = shows & (np.max([_parts(green_means(m, step)) for m in masks], axis=(0, 2)) == 0)
    count = int(np.count_nonzero(around))
    still = np.count_nonzero(around & same) / max(count, 1)
    height, width = (side // step for side in shape)
    rows, columns = (max(0, side - 2 * RIM) // PART for side in (height, width))
    details = (same & (contrast.min(axis=0) > limits.PLAIN_PART)).reshape(rows, columns)
    fixed = np.zeros((height, width), bool)
    inner = np.s_[RIM : RIM + rows * PART, RIM : RIM + columns * PART]
    fixed[inner] = np.kron(details, np.ones((PART, PART), bool))
    return Stillness(count, float(still), int(np.count_nonzero(shows & ~same)), fixed)


def attached(frames: Sequence[Frame], found: Stillness | None) -> np.ndarray | None:
    """Return what moves with the camera, uint8 of the images' size, 255 there; None: nothing.

    It is the convex hull of parts whose details are the same in nearly all photographs, as ``found`` says it,
    and a part around them. What is no scene anyway, such as a black border, does not count.
    """
    import cv2

    if found is None or found.still > limits.STILL_SHARE or not found.fixed.any():
        return None
    around, size = np.ones((2 * PART + 1, 2 * PART + 1), np.uint8), found.fixed.shape[::-1]
    fixed = found.fixed.astype(np.uint8)
    for known in (black_border(frames), frames[0].load_unknown()):
        if known is not None:
            small = cv2.resize(known.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            fixed[cv2.dilate(small, around) > 0] = 0
    if np.count_nonzero(fixed) < limits.FEWEST_PARTS * PART**2:
        return None
    outlines, _ = cv2.findContours(
        cv2.dilate(fixed, around), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
    )
    hulls = np.zeros_like(fixed)
    cv2.fillPoly(hulls, [cv2.convexHull(outline) for outline in outlines], [255])
    k = frames[0].camera.intrinsics
    return cv2.resize(hulls, (k.width, k.height), interpolation=cv2.INTER_NEAREST)


def write_attached(capture: Capture, path: Path) -> None:
    """Write what moves with the camera as an image, 255 there; a `DigsError` if nothing does."""
    marked = attached(capture.frames, stillness(capture.frames))
    if marked is None:
        raise DigsError(f"--write-ignore-mask: nothing in {capture} moves with the camera")
    write_image(path, marked)


def moves_along(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find what moves with the camera, on this share of the image or more."""
    found = attached(evidence.capture.frames, evidence.once(_stillness))
    share = 0.0 if found is None else float(np.mean(found > 0))
    return {"share": share} if share > least else None


def _parts(image: np.ndarray) -> np.ndarray:
    """Return the pixels of each part of a thumbnail, (parts, PART * PART), without its rim."""
    image = image[RIM : image.shape[0] - RIM, RIM : image.shape[1] - RIM]
    rows, columns = (side // PART for side in image.shape)
    cut = image[: rows * PART, : columns * PART].reshape(rows, PART, columns, PART)
    return cut.swapaxes(1, 2).reshape(rows * columns, PART * PART)


def moved(frames: Sequence[Frame]) -> bool:
    """Whether the poses say that the camera turned."""
    poses = np.stack([frame.camera.world_from_cam for frame in frames])
    return bool(np.max(turn_degrees(poses[:, :3, :3], poses[0, :3, :3])) > limits.LEAST_TURN)


def follows_object(evidence: Evidence) -> bool:
    """Whether the poses are those before a turning object: the camera stands still, but they turn."""
    frames = evidence.capture.frames
    has_masks = evidence.uses_masks and all(frame.has(Layer.MASK) for frame in frames)
    turns = has_masks and evidence.knows_poses and moved(frames)
    found = evidence.once(_stillness) if turns else None
    return found is not None and found.is_still


def _stillness(evidence: Evidence) -> Stillness | None:
    return stillness(evidence.capture.frames)


def still_camera(evidence: Evidence, _: float) -> dict[str, Any] | None:
    """Find recordings in which the surroundings stand still, as `Stillness` says it."""
    found = None if evidence.capture.frames[0].alone else evidence.once(_stillness)
    has_masks = all(frame.has(Layer.MASK) for frame in evidence.capture.frames)
    turns = found is not None and found.is_still and (found.changes or has_masks)
    return {"still": found.still} if found and turns else None


def camera_of_others(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find principal points off the middle by this share, across as well as down: of images of a size."""
    k = evidence.capture.frames[0].camera.intrinsics
    across, down = k.cx / k.width, k.cy / k.height
    if abs(across - 0.5) < least or abs(across - down) > least / 2:  # else a part of an image
        return None
    return {"across": across, "down": down, "size": f"{2 * k.cx:.0f}x{2 * k.cy:.0f}"}


def few_views(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find recordings of fewer frames."""
    count = len(evidence.capture)
    return {"views": counted(count, "frame")} if count < least else None


def repeats(evidence: Evidence, share: float) -> dict[str, Any] | None:
    """Find recordings of which more than this share of the frames repeat the one before."""
    frames = evidence.capture.frames
    if len(frames) < 2:
        return None
    starts = spread(len(frames) - 1, MOST_STEPS)
    numbers = sorted({*starts, *(start + 1 for start in starts)})
    reduced = thumbnails(
        [frames[i] for i in numbers],
        lambda image: green_means(image, max(1, image.shape[1] // WIDTH)),
    )
    seen = dict(zip(numbers, reduced, strict=True))
    steps = [(seen[i], seen[i + 1]) for i in starts]
    same = [a.shape == b.shape and np.abs(a - b).mean() < limits.SAME_THUMBNAIL for a, b in steps]
    if np.mean(same) <= share:
        return None
    return {"repeated": counted(sum(same), "frame"), "count": len(numbers)}


def exposure_jumps(evidence: Evidence, most: float) -> dict[str, Any] | None:
    """Find exposures that change more from frame to frame [stops] (median)."""
    found = evidence.once(median_exposure_change)
    return {"stops": found} if found is not None and found > most else None


def median_exposure_change(evidence: Evidence) -> float | None:
    """Return the change of the exposure from frame to frame [stops]; None: they show too little in common.

    Points that depth and poses lay on each other are compared; without these, matched features.
    """
    capture = evidence.capture
    if not (evidence.knows_poses and capture.has_depth):
        matches = matches_of_steps(capture.frames[:PHOTOGRAPHS])
        return exposure_change(ratio_of(*each.brightness) for each in matches if each)
    looked_at = spread(len(capture), PHOTOGRAPHS)
    pairs = [(n, n + 1) for n in looked_at if n + 1 < len(capture)]
    frames = small_frames(capture.frames, sorted({n for pair in pairs for n in pair}))
    known = [pair for pair in pairs if set(pair) <= frames.keys()]
    return exposure_change(brightness_ratio(frames[a], frames[b]) for a, b in known)
