"""The page's picture by our own rasterizer: all bands of the color, depth, normals.

What the browser draws is an approximation: base color only, 16-bit shapes, sorted now and then.
"""

import threading
from dataclasses import dataclass
from typing import Literal

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.geometry.camera import Camera
from digs_warp.splat.config import MEDIAN, Outputs, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import SplatRenderer

Shown = Literal["color", "depth", "normals"]

# Largest image [px]; the page stretches it.
MOST_WIDTH, MOST_HEIGHT = 1280, 1280

# Pixels covered by less than this have no depth and no normal.
LEAST_ALPHA = 0.5


@dataclass(frozen=True, eq=False)
class Drawn:
    """A picture for the background, and what of the page it hides.

    Attributes:
        image: on white, shape (height, width, 3), uint8.
        depth: planar median depth in the units of the Gaussians, infinite where nothing is seen, shape
            (height, width), float32.
    """

    image: np.ndarray
    depth: np.ndarray


class TrueRenderer:
    """Draws one set of Gaussians for any camera up to the largest size, for several threads."""

    def __init__(self, gaussians: Gaussians, device: str = "cpu") -> None:
        self._gaussians = DeviceGaussians.from_numpy(gaussians, device)
        self._center = gaussians.means.mean(axis=0)
        self._renderers: dict[Outputs, SplatRenderer] = {}
        self._one_at_a_time = threading.Lock()

    def draw(self, camera: Camera, shown: Shown) -> Drawn:
        """Return what the camera sees."""
        with self._one_at_a_time:
            renderer = self._renderer("normals" if shown == "normals" else "depth")
            renderer.forward(camera, near=near_plane(camera, self._center))
            depth = renderer.depth.to_numpy()[..., MEDIAN]
            seen = (renderer.transmittance.to_numpy()[..., 0] <= 1.0 - LEAST_ALPHA) & (depth > 0)
            if shown == "color":
                image = to_uint8(renderer.image.to_numpy())
            elif shown == "depth":
                image = painted_depth(depth, seen)
            else:
                image = painted_normals(renderer.normals.to_numpy(), seen)
            return Drawn(image, np.where(seen, depth, np.float32(np.inf)))

    def _renderer(self, outputs: Outputs) -> SplatRenderer:
        if outputs not in self._renderers:
            self._renderers[outputs] = SplatRenderer(
                self._gaussians, MOST_WIDTH, MOST_HEIGHT, options=RasterOptions(outputs=outputs)
            )
        return self._renderers[outputs]


def painted_depth(depth: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return depth in colors, near bright, white where nothing is seen, (height, width, 3), uint8."""
    import matplotlib

    picture = np.full((*depth.shape, 3), 255, np.uint8)
    if seen.any():
        low, high = np.percentile(depth[seen], [1, 99])
        share = np.clip((depth[seen] - low) / max(high - low, 1e-9), 0.0, 1.0)
        picture[seen] = to_uint8(matplotlib.colormaps["viridis"](1.0 - share)[:, :3])
    return picture


def painted_normals(normals: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return normals, any length, as colors (n + 1) / 2, white where nothing is seen; uint8."""
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    colors = 0.5 * (normals / np.maximum(length, 1e-9) + 1.0)
    return to_uint8(np.where(seen[..., None], colors, 1.0))
