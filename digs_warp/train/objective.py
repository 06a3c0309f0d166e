"""The loss of a step: the sum of all terms that the settings enable.

To add a term: write it in `digs_warp.losses`, give it a weight in `digs_warp.train.config`, and create, run
and sum it here. The logged loss is the sum of these terms, and Adam sees their gradients only.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.data.frame import Frame
from digs_warp.geometry.rigid import PixelBox
from digs_warp.losses.depth import DepthLoss
from digs_warp.losses.photometric import PhotometricLoss
from digs_warp.losses.regions import loss_blocks, read_region, union
from digs_warp.losses.target import Target, accept, erase, places_of
from digs_warp.measure.color_gain import ColorGain
from digs_warp.splat.bin_tiles import pixels_of
from digs_warp.splat.blur_renderer import BlurRenderer
from digs_warp.splat.surface_depth import covered_depth
from digs_warp.train.depth_errors import NO_ERRORS, DepthErrors
from digs_warp.train.views import View

# A term of the user's: of a training frame and its rendered image, sRGB, (height, width, 3), float32, the
# value, and its derivative by the image, of the image's shape.
OwnLoss: TypeAlias = Callable[[Frame, np.ndarray], tuple[float, np.ndarray]]


class Objective:
    """Compares a rendered image with a view, and writes the gradient of the loss for the renderer.

    Args:
        renderer: draws the views, with depth if that is compared; its `backward` pulls the gradient back.
        depth_weight: of the measured depth, default resolved; matters where the renderer draws depth.
    """

    def __init__(self, renderer: BlurRenderer, depth_weight: float = 0.0) -> None:
        r = renderer
        device = r.gaussians.device
        width, height = r.image.max_width, r.image.max_height
        self._renderer = renderer
        self._target = Target(width, height, device)
        self._photometric = PhotometricLoss(r.image, self._target.image, r.adj_image)
        self._own_value = 0.0
        self._depth = None
        if r.middle.options.has_depth:  # depth is measured in the middle of the exposure
            m = r.middle
            self._depth = DepthLoss(m.depth, m.transmittance, m.adj_depth, depth_weight)

    def compare(
        self,
        view: View,
        background: np.ndarray,
        gain: ColorGain | None = None,
        depth_errors: DepthErrors = NO_ERRORS,
    ) -> None:
        """Compute the terms for the last rendered image, and their gradients with respect to its pixels.

        Args:
            view: what the image shows; loaded with depth if the depth term is on.
            background: the sRGB color (3,) that the image was rendered over.
            gain: of the photograph, to be taken off. Default: none.
            depth_errors: what is wrong with the measured depth.
        """
        renderer = self._renderer
        drawn = renderer.drawn_tiles()
        blocks = loss_blocks(view.tiles, drawn)
        region = read_region(blocks, view.size)
        self._target.compose(
            view.pixels, view.box, background, region, view.size, gain, renderer.image
        )
        # Rendered image, target and gradient have the same layout.
        unknown = None if view.unknown is None else places_of(view.unknown, renderer.image)
        if unknown is not None:
            accept(unknown, renderer.image, self._target.image)
        self._photometric.run(view.size, blocks)
        if self._depth is not None and view.depth is None:
            self._depth.skip()
        elif self._depth is not None and view.depth is not None:
            boxes = view.box, pixels_of(drawn, *view.size)
            errors = depth_errors.offset, depth_errors.trust
            self._depth.run(view.depth, *boxes, *errors, slope_factor=renderer.moments)
        if unknown is not None:
            erase(unknown, renderer.adj_image)

    def add(self, loss: OwnLoss, frame: Frame, view: View, background: np.ndarray) -> None:
        """Add a term of the user's for the last rendered image; call it after `compare`.

        Args:
            loss: the term.
            frame: of ``view``.
            view: what the image shows.
            background: that it was rendered over.

        Raises:
            DigsError: a derivative of another shape.
        """
        renderer = self._renderer
        width, height = view.size
        image = np.empty((height, width, 3), np.float32)
        image[:] = background  # which is all that there is elsewhere
        drawn = renderer.drawn_box()
        x0, y0, x1, y1 = union(drawn, view.box)
        image[y0:y1, x0:x1] = renderer.image.part((x0, y0, x1, y1))
        self._own_value, derivative = loss(frame, image)
        gradient = check_shape("loss: the derivative", np.asarray(derivative), image.shape)
        x0, y0, x1, y1 = drawn
        renderer.adj_image.add(drawn, gradient[y0:y1, x0:x1])

    def images(self, box: PixelBox) -> tuple[np.ndarray, np.ndarray]:
        """Return a part of the last image, and of what it was compared with, (height, width, 3) each."""
        return self._renderer.image.part(box), self._target.image.part(box)

    def depth(self, box: PixelBox) -> np.ndarray | None:
        """Return the depth of a part of the last image, as `covered_depth` does; None if it was not drawn."""
        middle = self._renderer.middle
        return covered_depth(middle, box) if middle.options.has_depth else None

    @property
    def is_finite(self) -> bool:
        """Whether the loss of the last image is finite; waits for the device."""
        sums = [self._photometric.sums, *([self._depth.sums] if self._depth else [])]
        own = bool(np.isfinite(self._own_value))
        return own and all(np.isfinite(array.numpy()).all() for array in sums)

    def value(self) -> float:
        """Return the loss of the last image; waits for the device."""
        depth = self._depth.value() if self._depth else 0.0
        return self._photometric.value() + depth + float(self._own_value)
