"""Lenses that bend light: how the image of a pinhole camera is made from theirs.

Formulas and coefficients are OpenCV's: Brown's radial and tangential distortion of ordinary lenses, and the
polynomial of the angle of Kannala and Brandt (2006) for fisheye lenses.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from digs_warp.geometry.camera import Intrinsics, pixel_centers

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

# A map of 1600 x 900 takes 12 MB; a rig has two, and a few threads ask for them at the same time.
MAPS_KEPT = 4

# Where the lens says nothing: outside of every image.
NOWHERE = -1e4


@dataclass(frozen=True)
class Lens:
    """How a lens bends light.

    Attributes:
        coefficients: OpenCV's k1, k2, p1, p2, k3, k4, k5, k6 of an ordinary lens; k1 to k4 of a fisheye.
        is_fisheye: which of the two.
        eighth: of an ordinary lens, with the eighth power of the radius, where k1, k2 and k3 have the second,
            fourth and sixth: nerfstudio's k4.
    """

    coefficients: tuple[float, ...]
    is_fisheye: bool = False
    eighth: float = 0.0

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
        if not self.is_fisheye:
            _, _, p1, p2 = (*self.coefficients, 0.0, 0.0, 0.0, 0.0)[:4]
            bent[..., 0] += 2 * p1 * x * y + p2 * (radius**2 + 2 * x**2)
            bent[..., 1] += p1 * (radius**2 + 2 * y**2) + 2 * p2 * x * y
        return bent

    def _radial(self, radius: np.ndarray) -> np.ndarray:
        """Return the distance from the center for that in a pinhole image, both at focal length 1."""
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
        lens: what bends its light; None for a pinhole camera that only has to be turned.
        target: the pinhole camera.
        rotation: of the pinhole camera against the recorded one, rows of target_from_source.
    """

    source: Intrinsics
    lens: Lens | None
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

    def share_seen(self) -> float:
        """Return the share of the pinhole image that the recorded one shows, 0 to 1."""
        across, down = _maps(self)
        k = self.source
        inside = (
            (across > -0.5) & (across < k.width - 0.5) & (down > -0.5) & (down < k.height - 0.5)
        )
        return float(inside.mean())


def undistorted(k: Intrinsics, lens: Lens | None) -> PinholeView | None:
    """Return the pinhole view with the same ``k``: as sharp in the center, and without black corners.

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
        rays[rays[..., 2] <= 0] = np.nan
        flat = rays[..., :2] / rays[..., 2:] if view.lens is None else view.lens.distort(rays)
        places = flat * [k.fx, k.fy] + [k.cx - 0.5, k.cy - 0.5]
        places = np.where(np.abs(places) < -NOWHERE, places, NOWHERE)
    across, down = np.moveaxis(places.astype(np.float32), -1, 0)
    return np.ascontiguousarray(across), np.ascontiguousarray(down)
