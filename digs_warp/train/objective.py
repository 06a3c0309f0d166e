"""The loss of a step: all terms that the settings ask for, over one rendered view."""

import numpy as np

from digs_warp.losses.coverage import CoverageLoss
from digs_warp.losses.depth import DepthLoss
from digs_warp.losses.photometric import PhotometricLoss
from digs_warp.losses.regions import loss_blocks, read_region
from digs_warp.losses.target import Target
from digs_warp.splat.render import SplatRenderer
from digs_warp.train.config import TrainConfig
from digs_warp.train.views import View


class Objective:
    """Compares what a renderer drew with a view, and leaves the gradients where `backward` reads them."""

    def __init__(self, renderer: SplatRenderer, config: TrainConfig) -> None:
        r = renderer
        width, height = r.image.max_width, r.image.max_height
        self._renderer = renderer
        self._keeps_color = config.mask_role == "ignore"
        self._target = Target(width, height, r.device)
        self._photometric = PhotometricLoss(
            r.image, self._target.image, self._target.mask, r.adj_image, config.dssim_weight
        )
        self._coverage = self._depth = None
        if config.coverage_weight > 0:
            self._coverage = CoverageLoss(
                r.transmittance, self._target.mask, r.adj_transmittance, config.coverage_weight
            )
        if config.depth_weight > 0:
            self._depth = DepthLoss(r.depth, r.transmittance, r.adj_depth, config.depth_weight)

    def compare(self, view: View, background: np.ndarray) -> None:
        """Compute the loss of the last rendered image and its gradients.

        Args:
            view: what the image shows; read with depth if the settings weigh depth.
            background: the sRGB colour (3,) that the image was rendered over.
        """
        binner = self._renderer.binner
        blocks = loss_blocks(view.tiles, binner.drawn_tiles())
        region = read_region(blocks, view.size)
        self._target.compose(
            view.pixels, view.box, background, region, view.size, self._keeps_color
        )
        self._photometric.run(view.size, blocks, weighted=self._keeps_color)
        if self._coverage is not None:
            self._coverage.run(view.size, view.box, binner.drawn_box())
        if self._depth is not None and view.depth is not None:
            self._depth.run(view.depth, view.box, binner.drawn_box())

    def value(self) -> float:
        """Return the loss of the last `compare`; waits for the device."""
        terms = [self._photometric.value()[0]]
        terms += [term.value() for term in (self._coverage, self._depth) if term is not None]
        return sum(terms)
