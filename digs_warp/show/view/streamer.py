"""Draws the page's background for one browser while its camera moves: small at once, in full at rest."""

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, rigid
from digs_warp.show.view.true_render import MOST_HEIGHT, MOST_WIDTH, Drawn, Shown, TrueRenderer

if TYPE_CHECKING:
    import viser

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
