"""How it was recorded: too few views, repeated frames, blur and exposure."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence, brightness_ratio, exposure_change, ratio_of
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.device.threads import default_threads
from digs_warp.geometry.rigid import turn_degrees
from digs_warp.measure.thumbnails import green_means, small_frames, thumbnail_step, thumbnails
from digs_warp.poses.photo_matches import PhotoMatches, matches_of_steps
from digs_warp.words import counted

# Photographs that are looked at, evenly spread; the exposure is compared with that of the next frame.
PHOTOGRAPHS = 30

# The strongest edges: those above this quantile of all steps between neighboring pixels.
STRONGEST = 0.995

# Steps at 4 times the size of the pixels are compared. They are as large as those of single pixels in a sharp
# image, and 4 times as large in one that is blurred over more than 4 pixels.
COARSER = 4

# Steps between frames that are looked at for repeats, evenly spread, and columns of their thumbnails.
MOST_STEPS, WIDTH = 300, 40

# Photographs that are compared to see whether the camera moved, and the side of a compared part [thumbnail
# px]. A part stands still if it looks the same in this share of them.
STILLS, PART, MOSTLY = 8, 8, 0.75


@dataclass(frozen=True)
class Stillness:
    """What photographs far apart have in common, place by place.

    Attributes:
        parts: of the image that show something: outside of the masks, where there are masks.
        still: share of these that show the same in nearly all photographs, 0 to 1.
        changing: how many parts, in masks or not, do not.
    """

    parts: int
    still: float
    changing: int

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
    step = thumbnail_step(*reversed(sizes.pop()))
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
    return Stillness(count, float(still), int(np.count_nonzero(shows & ~same)))


def _parts(image: np.ndarray) -> np.ndarray:
    """Return the pixels of each part of a thumbnail, (parts, PART * PART); an odd rim is left out."""
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


def few_views(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find recordings of fewer frames."""
    count = len(evidence.capture)
    return {"views": counted(count, "frame")} if count < least else None


def repeats(evidence: Evidence, share: float) -> dict[str, Any] | None:
    """Find recordings of which more than this share of the frames repeat the one before."""
    frames, last = evidence.capture.frames, len(evidence.capture) - 1
    if last < 1:
        return None
    starts = np.unique(np.linspace(0, last - 1, min(MOST_STEPS, last)).round().astype(int))
    numbers = sorted({*starts.tolist(), *(starts + 1).tolist()})
    reduced = thumbnails(
        [frames[i] for i in numbers],
        lambda image: green_means(image, max(1, image.shape[1] // WIDTH)),
    )
    seen = dict(zip(numbers, reduced, strict=True))
    same = [_is_same(seen[i], seen[i + 1]) for i in starts.tolist()]
    if np.mean(same) <= share:
        return None
    return {"repeated": counted(sum(same), "frame"), "count": len(numbers)}


def _is_same(first: np.ndarray, second: np.ndarray) -> bool:
    return first.shape == second.shape and np.abs(first - second).mean() < limits.SAME_THUMBNAIL


def blurred(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find photographs whose median sharpness is less."""
    found = evidence.once(median_sharpness)
    return {"sharpness": found} if found is not None and found < least else None


def exposure_jumps(evidence: Evidence, most: float) -> dict[str, Any] | None:
    """Find exposures that change more from frame to frame [stops] (median)."""
    found = evidence.once(median_exposure_change)
    return {"stops": found} if found is not None and found > most else None


def _looked_at(evidence: Evidence) -> list[int]:
    last = len(evidence.capture) - 1
    return np.unique(np.linspace(0, last, min(PHOTOGRAPHS, last + 1)).round().astype(int)).tolist()


def median_exposure_change(evidence: Evidence) -> float | None:
    """Return the change of the exposure from frame to frame [stops]; None: they show too little in common.

    Points that depth and poses lay on each other are compared; without these, matched features.
    """
    capture = evidence.capture
    if not (evidence.knows_poses and capture.has_depth):
        return exposure_change(
            _matched_ratio(each) for each in matches_of_steps(capture.frames[:PHOTOGRAPHS])
        )
    pairs = [(n, n + 1) for n in _looked_at(evidence) if n + 1 < len(capture)]
    frames = small_frames(capture.frames, sorted({n for pair in pairs for n in pair}))
    known = [pair for pair in pairs if set(pair) <= frames.keys()]
    return exposure_change(brightness_ratio(frames[a], frames[b]) for a, b in known)


def _matched_ratio(matches: PhotoMatches | None) -> float | None:
    return None if matches is None else ratio_of(*matches.brightness)


def median_sharpness(evidence: Evidence) -> float | None:
    """Return the `sharpness` of the photographs; None: too plain to tell."""
    frames = [evidence.capture.frames[number] for number in _looked_at(evidence)]
    with ThreadPoolExecutor(default_threads()) as pool:
        found = [*pool.map(lambda frame: sharpness(frame.load_image()), frames)]
    valid = [each for each in found if each is not None]
    return float(np.median(valid)) if valid else None


def sharpness(image: np.ndarray) -> float | None:
    """Return how sharp an image is: 1 for the sharpest, 1 / COARSER for a blur over more pixels than that.

    Noise counts as sharp.

    Args:
        image: sRGB, shape (height, width, 3), uint8.

    Returns:
        None for an image that is too plain or too small to tell.
    """
    green = image[..., 1].astype(np.float32)
    height, width = (side // COARSER for side in green.shape)
    if min(height, width) < 2 * COARSER:
        return None
    blocks = green[: height * COARSER, : width * COARSER]
    coarse = blocks.reshape(height, COARSER, width, COARSER).mean(axis=(1, 3))
    strong = _strongest_step(coarse)
    return _strongest_step(green) / strong if strong >= limits.PLAIN_STEPS else None


def _strongest_step(image: np.ndarray) -> float:
    """Return the step between neighboring pixels that few exceed."""
    across, down = np.abs(np.diff(image, axis=1)), np.abs(np.diff(image, axis=0))
    return float(np.quantile(np.concatenate([across.reshape(-1), down.reshape(-1)]), STRONGEST))
