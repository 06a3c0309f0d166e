"""The training loop: render a view, compare, pull the gradient back, step (paper section 3.4)."""

import time
from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.gaussians import Gaussians
from digs_warp.losses import PhotometricLoss
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer, near_plane
from digs_warp.train.config import TrainConfig
from digs_warp.train.optimizer import Adam
from digs_warp.train.views import View, scene_extent

# A run spends this share of its steps before each further band of the view-dependent colour joins in: the
# base colour settles first.
SH_WARM_UP_SHARE = 0.1


class Trainer:
    """Optimizes Gaussians against views. Everything random follows from (seed, step).

    Attributes:
        gaussians: the parameters on the device; `DeviceGaussians.to_numpy` gives a copy.
        seconds: time spent in `step` so far.
    """

    def __init__(self, gaussians: Gaussians, views: Sequence[View], config: TrainConfig) -> None:
        if len(gaussians) == 0:
            raise DigsError("no Gaussians to train; the initialization found no points")
        k = views[0].camera.intrinsics
        self.views = views
        self.config = config
        self.gaussians = DeviceGaussians.from_numpy(gaussians, config.device)
        self.renderer = SplatRenderer(self.gaussians, k.width, k.height)
        self.loss = PhotometricLoss(
            self.renderer.image, self.renderer.adj_image, config.dssim_weight
        )
        extent = scene_extent([view.camera for view in views])
        self.optimizer = Adam(self.gaussians, self.renderer.gradients, config, extent)
        self.seconds = 0.0
        self._center = gaussians.means.mean(axis=0)

    def step(self) -> None:
        """Look at one view and take one step."""
        start = time.perf_counter()
        view = self.views[self._view_index()]
        background = self._background()
        self.renderer.forward(
            view.camera,
            near=near_plane(view.camera, self._center),
            background=background,
            sh_degree=self._sh_degree(),
        )
        self._compare(view, background)
        self.renderer.backward()
        self.optimizer.update()
        self.seconds += time.perf_counter() - start

    def repeat_loss(self) -> None:
        """Compute the loss of the next view against the image of the last step: for profiling."""
        self._compare(self.views[self._view_index()], self._background())

    def _compare(self, view: View, background: np.ndarray) -> None:
        """Compute loss and image gradient."""
        self.loss.set_target(view.pixels, background)
        self.loss.run(view.content, self.renderer.binner.drawn_box())

    def loss_value(self) -> float:
        """Return the loss of the last step.

        Raises:
            DigsError: it is not finite.
        """
        value = self.loss.value()[0]
        if not np.isfinite(value):
            raise DigsError(
                f"training diverged: the loss is {value} at iteration {self.optimizer.step}. "
                "Start again with smaller rates; the last checkpoint holds the state before."
            )
        return value

    def _view_index(self) -> int:
        """Return the view of this step: every epoch is a new shuffle."""
        epoch, position = divmod(self.optimizer.step, len(self.views))
        order = np.random.default_rng([self.config.seed, 0, epoch]).permutation(len(self.views))
        return int(order[position])

    def _background(self) -> np.ndarray:
        if self.config.background == "random":
            return np.random.default_rng([self.config.seed, 1, self.optimizer.step]).uniform(size=3)
        return np.full(3, 1.0 if self.config.background == "white" else 0.0)

    def _sh_degree(self) -> int:
        wait = max(1.0, SH_WARM_UP_SHARE * self.config.iterations)
        return min(self.config.sh_degree, int(self.optimizer.step / wait))
