"""Makes images and depth of other cameras those of a capture's camera: undistorted, turned, registered.

Formulas and coefficients are OpenCV's: Brown's radial and tangential distortion of ordinary lenses, and the
polynomial of the angle of Kannala and Brandt (2006) for fisheye lenses.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from digs_warp.geometry.camera import Intrinsics, pixel_centers
from digs_warp.geometry.rigid import transform_points

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

# A map of 1600 x 900 takes 12 MB; a rig has two, and a few threads ask for them at the same time.
MAPS_KEPT = 4

# Where the lens says nothing: outside of every image.
NOWHERE = -1e4


# Other lenses of COLMAP: the distance from the center for that in a pinhole image, and their parameters.
# Devernay and Faugeras (2001), Fitzgibbon (2001), and Khomutenko et al. (2016).
CURVES: dict[str, Callable[..., np.ndarray]] = {
    "FOV": lambda r, omega: np.arctan(2 * r * np.tan(omega / 2)) / omega,
    "DIVISION": lambda r, k: 2 * r / (1 + np.sqrt(1 - 4 * k * r**2)),
    "EUCM": lambda r, alpha, beta: r / (alpha * np.sqrt(beta * r**2 + 1) + 1 - alpha),
}


@dataclass(frozen=True)
class Lens:
    """How a lens bends light.

    Attributes:
        coefficients: OpenCV's k1, k2, p1, p2, k3, k4, k5, k6 of an ordinary lens; k1 to k4 of a fisheye.
        is_fisheye: which of the two.
        eighth: of an ordinary lens, with the eighth power of the radius, where k1, k2 and k3 have the second,
            fourth and sixth: nerfstudio's k4.
        curve: one of `CURVES`, whose parameters the coefficients are; else empty.
    """

    coefficients: tuple[float, ...]
    is_fisheye: bool = False
    eighth: float = 0.0
    curve: str = ""

    @staticmethod
    def brown(*coefficients: float) -> "Lens | None":
        """Return an ordinary lens; None if it bends nothing."""
        return Lens(coefficients) if any(coefficients) else None

    def distort(self, rays: np.ndarray) -> np.ndarray:
        """Return where the lens puts rays on its plane at distance 1.

        Args:
            rays: directions, z above 0, shape (..., 3).

        Returns:
            Shape (..., 2); NaN beyond the angle from which on the polynomial runs backward.
        """
        x, y = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
        radius = np.hypot(x, y)
        factor = self._radial(radius) / np.maximum(radius, 1e-12)
        factor = np.where(radius < self._last_radius(float(radius.max())), factor, np.nan)
        bent = np.stack([x * factor, y * factor], axis=-1)
        if not (self.is_fisheye or self.curve):
            _, _, p1, p2 = (*self.coefficients, 0.0, 0.0, 0.0, 0.0)[:4]
            bent[..., 0] += 2 * p1 * x * y + p2 * (radius**2 + 2 * x**2)
            bent[..., 1] += p1 * (radius**2 + 2 * y**2) + 2 * p2 * x * y
        return bent

    def _radial(self, radius: np.ndarray) -> np.ndarray:
        """Return the distance from the center for that in a pinhole image, both at focal length 1."""
        if self.curve:
            return CURVES[self.curve](radius, *self.coefficients)
        if self.is_fisheye:
            angle = np.arctan(radius)
            k1, k2, k3, k4 = (*self.coefficients, 0.0, 0.0, 0.0, 0.0)[:4]
            s = angle**2
            return angle * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
        k1, k2, _, _, k3, k4, k5, k6 = (*self.coefficients, *[0.0] * 8)[:8]
        s = radius**2
        above = 1 + s * (k1 + s * (k2 + s * (k3 + s * self.eighth)))
        return radius * above / (1 + s * (k4 + s * (k5 + s * k6)))

    def _last_radius(self, farthest: float) -> float:
        """Return up to where the image grows with the angle; beyond, the polynomial means nothing."""
        radii = np.linspace(0, farthest, 512)
        with np.errstate(all="ignore"):
            growing = np.diff(self._radial(radii)) > 0
        return np.inf if growing.all() else float(radii[np.argmin(growing)])


@dataclass(frozen=True)
class PinholeView:
    """A recorded image, and the pinhole camera whose image is made from it.

    Attributes:
        source: the recorded image's camera, without its lens.
        lens: what bends its light.
        target: the pinhole camera.
        rotation: target from source, rows of a (3, 3) matrix.
    """

    source: Intrinsics
    lens: Lens
    target: Intrinsics
    rotation: tuple[float, ...] = IDENTITY

    def with_field_of_view(self, degrees: float) -> "PinholeView":
        """Return the view with a centered target that sees this much from left to right."""
        k = self.target
        wide = Intrinsics.from_fov(k.width, k.height, degrees)
        return replace(self, target=replace(wide, fy=wide.fx * k.fy / k.fx))

    def apply(self, pixels: np.ndarray, *, nearest: bool = False) -> np.ndarray:
        """Return what the pinhole camera sees of an image, (height, width, ...).

        Args:
            pixels: of the recorded image.
            nearest: take the nearest pixel, never a mean; where there is none, floats become NaN.
        """
        import cv2

        across, down = _maps(self)
        outside = np.nan if pixels.dtype.kind == "f" else 0
        how = cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR
        return cv2.remap(
            pixels, across, down, how, borderMode=cv2.BORDER_CONSTANT, borderValue=outside
        )

    def outside(self) -> np.ndarray:
        """Return where the recorded image shows nothing, (height, width), bool; there `apply` gives black."""
        across, down = _maps(self)
        k = self.source
        return (across < 0) | (across > k.width - 1) | (down < 0) | (down > k.height - 1)


def undistorted(k: Intrinsics, lens: Lens | None) -> PinholeView | None:
    """Return the pinhole view with the same ``k``: as sharp in the center.

    None: there is no lens.
    """
    return None if lens is None else PinholeView(k, lens, k)


@lru_cache(MAPS_KEPT)
def _maps(view: PinholeView) -> tuple[np.ndarray, np.ndarray]:
    """Return for each pixel of the target its column and row in the source, centers at integers, float32."""
    k = view.target
    centers = pixel_centers(k.width, k.height)
    rays = np.dstack([(centers - [k.cx, k.cy]) / [k.fx, k.fy], np.ones((k.height, k.width))])
    rays = rays @ np.reshape(view.rotation, (3, 3))  # rows: source from target is the transpose
    k = view.source
    with np.errstate(all="ignore"):
        places = view.lens.distort(rays) * [k.fx, k.fy] + [k.cx - 0.5, k.cy - 0.5]
        places = np.where(np.abs(places) < -NOWHERE, places, NOWHERE)
    across, down = np.moveaxis(places.astype(np.float32), -1, 0)
    return np.ascontiguousarray(across), np.ascontiguousarray(down)


# A pixel of a depth camera covers at most this many columns and rows of the color image, and one more.
LARGEST_SQUARE = 15


def resample_depth(depth: np.ndarray, source: Intrinsics, target: Intrinsics) -> np.ndarray:
    """Return the depth that ``target`` sees, (height, width): the nearest pixel of ``source``, never a mean.

    Both cameras have the same pose, so a ray keeps its planar depth; NaN where
    ``source`` does not look.
    """
    if source == target:
        return depth
    centers = pixel_centers(target.width, target.height)
    u = (centers[..., 0] - target.cx) / target.fx * source.fx + source.cx
    v = (centers[..., 1] - target.cy) / target.fy * source.fy + source.cy
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    inside = (column >= 0) & (column < source.width) & (row >= 0) & (row < source.height)
    found = np.full((target.height, target.width), np.nan, np.float32)
    found[inside] = depth[row[inside], column[inside]]
    return found


def register_depth(
    depth: np.ndarray, source: Intrinsics, target: Intrinsics, target_from_source: np.ndarray
) -> np.ndarray:
    """Return the depth that ``target``, a camera in another place, sees of the points of ``source``.

    Each pixel of ``source`` is a square that faces its camera; what is nearest hides the rest.

    Args:
        depth: planar depth [m], (height, width), NaN where unknown.
        source: its camera.
        target: the other camera.
        target_from_source: rigid motion [m], (4, 4).

    Returns:
        Planar depth [m], (height, width), float32; NaN where no point is seen.
    """
    rows, columns = np.nonzero(np.isfinite(depth))
    z = depth[rows, columns].astype(np.float64)
    low, nearness = _projected(columns, rows, z, source, target, target_from_source)
    high, _ = _projected(columns + 1, rows + 1, z, source, target, target_from_source)
    # A square covers the pixels whose centers lie in it, and at least the one in its middle.
    middle = np.floor((low + high) / 2)
    first = np.minimum(np.ceil(low - 0.5), middle)
    last = np.maximum(np.ceil(high - 0.5) - 1, middle)
    seen = (nearness > 0) & np.isfinite(first).all(1) & np.isfinite(last).all(1)
    first, last, nearness = first[seen], last[seen], nearness[seen]
    found = np.full((target.height, target.width), np.inf)
    widest = (last - first).max(axis=0, initial=0).clip(0, LARGEST_SQUARE).astype(int)
    for right in range(widest[0] + 1):
        for down in range(widest[1] + 1):
            place = first + [right, down]
            inside = ((place <= last) & (place >= 0) & (place < [target.width, target.height])).all(
                1
            )
            column, row = place[inside].astype(np.intp).T
            np.minimum.at(found, (row, column), nearness[inside])
    return np.where(np.isfinite(found), found, np.nan).astype(np.float32)


def _projected(
    u: np.ndarray,
    v: np.ndarray,
    z: np.ndarray,
    source: Intrinsics,
    target: Intrinsics,
    target_from_source: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the places (u, v) in ``target``, (n, 2), and depths [m], (n,), of those in ``source``."""
    x, y = (u - source.cx) / source.fx * z, (v - source.cy) / source.fy * z
    moved = transform_points(target_from_source, np.stack([x, y, z], axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        places = moved[:, :2] / moved[:, 2:] * [target.fx, target.fy] + [target.cx, target.cy]
    return places, moved[:, 2]
