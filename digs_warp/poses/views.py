"""Frames as the alignment compares them: images without their exposure, depth, and points to look up.

`arrays_of` lays those of all frames behind one another for the kernels.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import warp as wp

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.reproject import unproject_pixels
from digs_warp.poses.lookup import Target

# Blur that takes off noise, and the neighborhood whose mean and contrast do not count [px].
FINE, WIDE = 0.8, 6.0
# Contrast below which a neighborhood is noise rather than texture, in 0..1.
DULL = 0.02
# Points of a frame that are compared, those of the largest image gradient in their part of the image.
POINTS = 4000
# A pixel whose neighbors' depth differs by more than this share lies on a rim, where depth is smeared.
RIM = 0.03
# Added to all colors before their tint is taken: that of dark pixels is noise.
DARK = 16
# The widest image that is compared [px].
WIDEST = 640
# Brightness of sRGB red, green and blue (BT.601).
LUMA = np.array([0.299, 0.587, 0.114], np.float32)

# A frame at one size: a `Picture` or a `View`.
Sized = TypeVar("Sized")


@dataclass(frozen=True, eq=False)
class Picture:
    """A frame's pixels at one size.

    Attributes:
        intrinsics: of this size.
        brightness: 0..1, (height, width), float32.
        depth: planar z [m], (height, width), float32, NaN where unknown.
        tint: shares of red and green in the color, which no exposure changes, (height, width, 2), float32.
        turn, shift: motion of the camera while all rows are read, (3,) each, in the axes of the middle row
            [rad, m]; 0 where it is not known.
    """

    intrinsics: Intrinsics
    brightness: np.ndarray
    depth: np.ndarray
    tint: np.ndarray
    turn: np.ndarray
    shift: np.ndarray

    def at_most(self, widest: int) -> "Picture":
        """Return the picture, halved until it is no wider than ``widest`` [px]."""
        return self if self.intrinsics.width <= widest else self.halved().at_most(widest)

    def halved(self) -> "Picture":
        """Return the picture at half the size; a last odd row or column is left out."""
        k = self.intrinsics
        smaller = Intrinsics(k.width // 2, k.height // 2, k.fx / 2, k.fy / 2, k.cx / 2, k.cy / 2)
        brightness, depth, red, green = (
            _half(plane[: 2 * smaller.height, : 2 * smaller.width])
            for plane in (self.brightness, self.depth, self.tint[..., 0], self.tint[..., 1])
        )
        tint = np.stack([red, green], axis=2)
        return replace(self, intrinsics=smaller, brightness=brightness, depth=depth, tint=tint)

    def sizes(self, most: int, least: int = 1) -> list["Picture"]:
        """Return up to ``most`` sizes of the picture, each half of the next, none narrower than ``least``."""
        sizes: list[Picture] = [self]
        while len(sizes) < most and sizes[-1].intrinsics.width >= 2 * least:
            sizes.append(sizes[-1].halved())
        return sizes[::-1]


def by_size(frames: Sequence[Sequence[Sized]]) -> list[tuple[Sized, ...]]:
    """Return what there is of all frames at each size, smallest first.

    Args:
        frames: of n frames, the sizes of each, smallest first. One that has fewer, for its images are smaller
            than others, keeps its smallest.
    """
    most = max(map(len, frames), default=0)
    return [tuple(sizes[-min(len(sizes), most - each)] for sizes in frames) for each in range(most)]


@dataclass(frozen=True, eq=False)
class View:
    """A picture as it is compared with others.

    Attributes:
        picture: what it was made from.
        image: brightness, less its mean and over its contrast nearby, (height, width), float32.
        points: in the axes of the camera at the middle row [m], (n, 3), float32.
        values: of the image at the points, (n,), float32.
    """

    picture: Picture
    image: np.ndarray
    points: np.ndarray
    values: np.ndarray


def load_pictures(frames: Sequence[Frame], readout_time: float) -> list[Picture]:
    """Read the frames on all cores, reduced to at most `WIDEST` columns; the depth of some may be missing.

    Args:
        frames: with images.
        readout_time: from the first row to the last [s]; 0: all rows at once.
    """
    with ThreadPoolExecutor(default_threads()) as pool:
        return list(pool.map(lambda frame: _picture(frame, readout_time), frames))


def _picture(frame: Frame, readout_time: float) -> Picture:
    image = frame.load_image()
    known = frame.has(Layer.DEPTH)
    motion = frame.exposure.camera_motion
    color = image.astype(np.float32) + DARK
    # A product is exact, and faster than a sum over so short an axis.
    total = color @ np.ones((3, 1), np.float32)
    found = Picture(
        frame.camera.intrinsics,
        image.astype(np.float32) @ (LUMA / np.float32(255)),
        frame.load_depth() if known else np.full(image.shape[:2], np.nan, np.float32),
        color[..., :2] / total,
        readout_time * np.array(motion.angular_velocity) if motion else np.zeros(3),
        readout_time * np.array(motion.velocity) if motion else np.zeros(3),
    )
    return found.at_most(WIDEST)


def _half(plane: np.ndarray) -> np.ndarray:
    """Return the means of squares of four pixels; ten times as fast as ``mean`` of a reshaped plane."""
    rows = plane[0::2] + plane[1::2]
    return (rows[:, 0::2] + rows[:, 1::2]) * np.float32(0.25)


def view_of(picture: Picture, points: int = POINTS) -> View:
    """Return a picture with about ``points`` points that others look up; without depth it has none."""
    from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

    fine = gaussian_filter(picture.brightness, FINE)
    high = fine - gaussian_filter(picture.brightness, WIDE)
    image = (high / (np.sqrt(gaussian_filter(high**2, WIDE)) + DULL)).astype(np.float32)
    known = np.where(np.isfinite(picture.depth), picture.depth, np.float32(-1e6))
    flat = maximum_filter(known, 3) - minimum_filter(known, 3) < RIM * known
    rows, columns = np.gradient(image) if min(image.shape) > 1 else (image, image)
    y, x = _strongest(np.where(flat, np.hypot(rows, columns), 0), points)
    return View(picture, image, _points(picture, y, x), image[y, x])


def _points(picture: Picture, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the points of pixels, in the axes of the middle row."""
    k, z = picture.intrinsics, picture.depth[y, x]
    seen = unproject_pixels(y, x, z, k)
    moment = ((y + 0.5) / k.height - 0.5)[:, None]
    return (seen + moment * (np.cross(picture.turn, seen) + picture.shift)).astype(np.float32)


def _strongest(strength: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of about ``points`` pixels: in every cell of a grid the strongest above 0."""
    cell = max(1, int(np.ceil(np.sqrt(np.count_nonzero(strength) / points))))
    height, width = (-(-n // cell) for n in strength.shape)
    padded = np.zeros((height * cell, width * cell))
    padded[: strength.shape[0], : strength.shape[1]] = strength
    cells = padded.reshape(height, cell, width, cell).swapaxes(1, 2).reshape(height, width, -1)
    rows, columns = np.nonzero(cells.max(axis=2) > 0)
    inside = cells.argmax(axis=2)[rows, columns]
    return rows * cell + inside // cell, columns * cell + inside % cell


def arrays_of(views: Sequence[View]) -> list[wp.array]:
    """Return the first point of each frame, all points and their values, `Target`s, images and depth."""
    sizes = np.cumsum([0, *(view.image.size for view in views)])
    form: Any = Target.numpy_dtype()
    rows = [_target(view, int(at)) for view, at in zip(views, sizes, strict=False)]
    counts = np.cumsum([0, *(len(view.points) for view in views)])
    return [
        wp.array(counts.astype(np.int32), dtype=int, device="cpu"),
        wp.array(np.concatenate([view.points for view in views]), dtype=wp.vec3, device="cpu"),
        _floats([view.values for view in views]),
        wp.array(np.array(rows, dtype=form), dtype=Target, device="cpu"),
        _floats([view.image.reshape(-1) for view in views]),
        _floats([view.picture.depth.reshape(-1) for view in views]),
    ]


def _target(view: View, offset: int) -> tuple[object, ...]:
    k, picture = view.picture.intrinsics, view.picture
    motion = (tuple(picture.turn), tuple(picture.shift))
    return (offset, k.width, k.height, k.fx, k.fy, k.cx, k.cy, *motion)


def _floats(parts: Sequence[np.ndarray]) -> wp.array:
    return wp.array(np.concatenate(parts).astype(np.float32), dtype=float, device="cpu")
