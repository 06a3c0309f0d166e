"""What is no scene: black borders of photographs that were undistorted, and what a user marks.

A border is black, touches the rim, is the same in all photographs of a camera, and ends in each of them where
it ends in all: what is only dark, a night or a black backdrop, reaches farther in some photographs than in
others.
"""

import logging
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import mask_of, read_image, write_image
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.measure.thumbnails import thumbnails

logger = logging.getLogger(__name__)

# The brightest channel of a border [of 255]: JPEG is not exact.
BLACK = 10
# Photographs that are looked at, and the fewest that tell that a border is the same in all.
LOOKED_AT, FEWEST = 12, 4
# A smaller border [share of the image] does no harm. Of the photographs, MOST have no larger black rim than
# the border by OWN_MORE.
LEAST_BORDER, OWN_MORE, MOST = 0.001, 1.1, 0.75
# The border is taken wider by this [px]: its last pixels are mixed with the scene, or rung by JPEG.
WIDER = 3


def without_no_scene(capture: Capture, marked: Path | None, folder: Path) -> Capture:
    """Return the recording with what is no scene as the layer `Layer.UNKNOWN`, in addition to its own.

    Args:
        capture: the recording; in a simulated one nothing is looked for.
        marked: a file that marks what to leave out in all images, as `--ignore-mask` has it; None: nothing.
        folder: where the layer is written.

    Raises:
        DigsError: ``marked`` is no mask of the size of the images.
    """
    marks = None if marked is None else mask_of(read_image(marked, "--ignore-mask"))[0] > 127
    groups = defaultdict[tuple[int, int], list[Frame]](list)
    for frame in capture.frames:
        groups[frame.camera.intrinsics.height, frame.camera.intrinsics.width].append(frame)
    files: dict[tuple[int, int], Path] = {}
    for size, frames in groups.items():
        if marks is not None and marks.shape != size:
            raise DigsError(
                f"--ignore-mask '{marked}': {marks.shape[1]}x{marks.shape[0]} pixels, expected {size[1]}x"
                f"{size[0]} as the image of '{frames[0].name}' has; draw it on one of the images"
            )
        known = capture.about.tier is not None or any(f.has(Layer.UNKNOWN) for f in frames)
        border = None if known else black_border(frames)
        if border is not None:
            logger.warning(
                "%s: %.1f %% of the images are a black border, the same in all: it is left out of training "
                "and scores",
                *(capture, 100 * border.mean()),
            )
        found = [each for each in (marks, border) if each is not None]
        if found:
            files[size] = folder / f"no_scene_{size[1]}x{size[0]}.png"
            write_image(files[size], np.where(np.any(found, axis=0), 255, 0).astype(np.uint8))

    def marked_too(frame: Frame) -> Frame:
        size = (frame.camera.intrinsics.height, frame.camera.intrinsics.width)
        if size not in files:
            return frame
        own = frame.load_unknown() if frame.has(Layer.UNKNOWN) else None
        layer = files[size] if own is None else np.where(own, 255, read_image(files[size])[..., 0])
        return frame.with_layer(Layer.UNKNOWN, layer)

    return replace(capture, frames=tuple(map(marked_too, capture.frames))) if files else capture


def black_border(frames: Sequence[Frame]) -> np.ndarray | None:
    """Return the black border of photographs of one size, (height, width), bool; None: there is none."""
    import cv2

    if len(frames) < FEWEST:
        return None
    black = thumbnails(evenly(frames, LOOKED_AT), lambda image: image.max(axis=2) <= BLACK)
    border = _at_the_rim(np.all(black, axis=0))
    size = np.count_nonzero(border)
    if size < LEAST_BORDER * border.size:
        return None
    own = np.quantile([np.count_nonzero(_at_the_rim(each)) for each in black], MOST)
    if own > OWN_MORE * size or size == border.size:
        return None
    square = np.ones((2 * WIDER + 1, 2 * WIDER + 1), np.uint8)
    return cv2.dilate(border.astype(np.uint8), square) > 0


def _at_the_rim(black: np.ndarray) -> np.ndarray:
    """Return the pieces of the true pixels that touch the rim of the image, (height, width), bool."""
    import cv2

    labels = cv2.connectedComponents(black.astype(np.uint8), connectivity=4)[1]
    rim = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return np.isin(labels, np.setdiff1d(rim, [0]))
