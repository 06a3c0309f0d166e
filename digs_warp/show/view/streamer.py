"""Draws the page's background for one browser while its camera moves: small at once, in full at rest.

It is drawn by our own rasterizer: all bands of the color, depth, normals. What the browser draws is an
approximation: base color only, 16-bit shapes, sorted now and then.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, rigid
from digs_warp.splat.config import MEDIAN, Outputs, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import SplatRenderer

if TYPE_CHECKING:
    import viser


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


# Width of the image while the camera moves [px], and how long it has to rest for a full one [s].
MOVING_WIDTH, REST_SECONDS = 480, 0.25

# A window that is smaller [px] is not drawn yet, or folded away.
LEAST_SIZE = 16

Ask = Callable[[], tuple[TrueRenderer, Shown] | None]


class Streamer:
    """A thread that keeps one browser's background up to date.

    Args:
        client: the browser.
        ask: returns what to draw now, and None for no background.
    """

    def __init__(self, client: "viser.ClientHandle", ask: Ask) -> None:
        self._client = client
        self._ask = ask
        self._changed = threading.Event()
        self._ended = False
        self._shows_image = False
        self._thread = threading.Thread(target=self._run, name="true render", daemon=True)
        client.camera.on_update(lambda _: self.update())
        self._thread.start()

    def update(self) -> None:
        """Draw again: the camera has moved, or something else is to be shown."""
        self._changed.set()

    def end(self) -> None:
        """Stop the thread; an image that is being drawn is finished first."""
        self._ended = True
        self._changed.set()
        self._thread.join()

    def _run(self) -> None:
        while True:
            self._changed.wait()
            self._changed.clear()
            if self._ended:
                return
            self._draw(MOVING_WIDTH)
            if not self._changed.wait(REST_SECONDS):
                self._draw(MOST_WIDTH)

    def _draw(self, width: int) -> None:
        asked = self._ask()
        if asked is None:
            if self._shows_image:
                self._client.scene.set_background_image(None)
            self._shows_image = False
            return
        renderer, shown = asked
        camera = camera_of(self._client.camera, width)
        if camera is not None:
            put_behind(self._client.scene, renderer.draw(camera, shown))
            self._shows_image = True


def put_behind(scene: "viser.SceneApi", drawn: Drawn) -> None:
    """Encode a picture and send it as the background, with the depth that hides what is behind it."""
    scene.set_background_image(drawn.image, format="jpeg", jpeg_quality=85, depth=drawn.depth)


def camera_of(handle: "viser.CameraHandle", most_width: int) -> Camera | None:
    """Return the camera of a browser's window on the page, at most so wide; None before it is drawn.

    Its axes are OpenCV's as ours are; ``fov`` is the vertical angle.
    """
    if min(handle.image_width, handle.image_height) < LEAST_SIZE:
        return None
    size = handle.image_width, handle.image_height
    share = min(1.0, most_width / size[0], MOST_HEIGHT / size[1])
    width, height = (max(LEAST_SIZE, round(share * side)) for side in size)
    focal = 0.5 * height / np.tan(0.5 * handle.fov)
    k = Intrinsics(width, height, float(focal), float(focal), width / 2, height / 2)
    rotation = matrix_from_quat_xyzw(np.roll(handle.wxyz, -1))
    return Camera(k, rigid(rotation, handle.position))
