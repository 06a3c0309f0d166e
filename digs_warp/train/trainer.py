"""The training loop: render a view, compare, backpropagate, step (paper section 3.4)."""

import time
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.geometry.sh import degree_from_count
from digs_warp.measure.color_gain import ColorGain
from digs_warp.poses.in_training import PoseTraining, TrainedPoses
from digs_warp.splat.blur_renderer import BlurRenderer
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians, move_gaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.surface_depth import surface_place
from digs_warp.train.config import BACKGROUND, TrainConfig
from digs_warp.train.density import DensityControl, Refinement
from digs_warp.train.depth_errors import (
    NO_ERRORS,
    TRUSTED_IN_SCENES,
    TRUSTED_SPREAD,
    DepthErrors,
    DepthJudge,
    rendered_depths,
)
from digs_warp.train.exposure import Exposures, rendered_samples
from digs_warp.train.merging import MERGE_AT, merged
from digs_warp.train.objective import Objective, OwnLoss
from digs_warp.train.optimizer import Adam, non_finite_rows
from digs_warp.train.smoothing import SmoothingFilter
from digs_warp.train.view_store import ViewStore
from digs_warp.train.views import View, scene_extent
from digs_warp.words import counted

# Share of a run's steps before the next band of view-dependent color is switched on: the base color
# settles first.
SH_WARM_UP_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Resolved:
    """What was found out for a training, beside its settings."""

    held: np.ndarray | None = None  # which Gaussians stay as they are, shape (n,), bool; None: none
    # What the cameras do until their photographs fit, held-out ones at the end.
    train_poses: PoseTraining = "held"
    constant_exposure: bool = False  # whether that of the views is known to be constant
    loss: OwnLoss | None = None  # a further term, of the caller; a resumed training needs the same
    # Of a run whose iterations were planned for its time; None: these.
    most_steps: int | None = None


class Trainer:
    """Optimizes Gaussians against views. Everything random follows from (seed, step).

    Args:
        gaussians: the initial Gaussians, at least one.
        views: what to train on; their sizes may differ.
        config: settings.
        resolved: what was found out before.

    Attributes:
        gaussians: the parameters on the device, with effective scales; `DeviceGaussians.to_numpy` gives a
            copy.
        optimizer: holds the step count and the moments.
        smoothing: the filter in 3D, with the scales that are learned.
        control: changes the number of Gaussians; None where that stays.
        exposures: the gains of the photographs; None where they are not fitted.
        depth_judge: knows the errors of the measured depth; None where that does not count.
        poses: of the views; None where they are not trained.
        most_steps: of the run.
        seconds: time spent in `step` so far.
    """

    def __init__(
        self,
        gaussians: Gaussians,
        views: ViewStore,
        config: TrainConfig,
        resolved: Resolved | None = None,
    ) -> None:
        if len(gaussians) == 0:
            raise DigsError("no Gaussians to train; the initialization found no points")
        resolved = resolved or Resolved()
        self.views = views
        self.config = config
        self.seconds = 0.0
        self.gaussians = DeviceGaussians.from_numpy(gaussians, config.device)
        self._start_count = len(gaussians)
        sizes = [camera.intrinsics for camera in views.cameras]
        depth_weight = config.resolved_depth_weight(views.have_depth)
        place = surface_place(views.have_masks)
        self.renderer = BlurRenderer(
            self.gaussians,
            max(k.width for k in sizes),
            max(k.height for k in sizes),
            options=RasterOptions(
                outputs="mean depth" if depth_weight > 0 else "color", depth_of=place
            ),
            moments=views.moments,
        )
        self.most_steps = resolved.most_steps or config.stop.iterations
        self._extent = scene_extent(views.cameras)
        self.objective = Objective(self.renderer, depth_weight)
        self._loss = resolved.loss
        self._center = gaussians.means.mean(axis=0)
        self.control: DensityControl | None = None
        if config.density.strategy == "adaptive":
            self.control = DensityControl(len(gaussians), config, self._extent)
        self.exposures: Exposures | None = None
        if config.fit_exposure == "on":
            self.exposures = Exposures(len(views), resolved.constant_exposure)
        trusted = TRUSTED_SPREAD if views.have_masks else TRUSTED_IN_SCENES
        self.depth_judge = DepthJudge(len(views), trusted) if depth_weight > 0 else None
        self.poses: TrainedPoses | None = None
        if resolved.train_poses != "held":
            steps, shifts = config.stop.iterations, resolved.train_poses == "moved"
            self.poses = TrainedPoses(views.cameras, gaussians.means, steps, shifts)
        self._build_optimizer(step=0)
        if resolved.held is not None:
            self.optimizer.hold(resolved.held)

    def step(self) -> None:
        """Take one step on one view.

        Raises:
            DigsError: the loss or a parameter is not finite; the message says which one and where.
        """
        start, before = time.perf_counter(), self.progress
        view = self._view()
        background = self._background()
        self.renderer.forward(
            view.camera,
            near=near_plane(view.camera, self._center),
            background=background,
            sh_degree=self._sh_degree(),
            content=view.box,
            rows=view.rows,
            blur=view.blur,
        )
        self.objective.compare(view, background, self._gain(view), self._depth_errors(view))
        if self._loss is not None:
            frame = self.views.frame(self.optimizer.step)
            self.objective.add(self._loss, frame, view, background)
        self.renderer.backward()
        if self.poses is not None:
            self._move_camera(self.poses, view)
        self.smoothing.before_update()
        self.optimizer.update(self.progress)
        self.smoothing.after_update(self.optimizer.step)
        self._require_finite(view)
        if self.control is not None:
            refinement = self.control.after_update(self.gaussians, self.optimizer.step)
            if refinement is not None:
                self.adopt(refinement)
        self.seconds += time.perf_counter() - start
        if self.control is None and before < MERGE_AT <= self.progress:
            self._merge()

    def adopt(self, refinement: Refinement) -> None:
        """Continue with a new population; each Gaussian brings its moments along."""
        before = (self.optimizer.moments_1.to_numpy(), self.optimizer.moments_2.to_numpy())
        self._replace(refinement.gaussians, self.optimizer.step)
        after = (self.optimizer.moments_1, self.optimizer.moments_2)
        for old, new in zip(before, after, strict=True):
            for name, array in zip(FIELDS, new.arrays, strict=True):
                array.assign(refinement.moments(name, getattr(old, name)))

    def restore(
        self,
        gaussians: Gaussians,
        moments: tuple[Gaussians, Gaussians],
        smoothing: dict[str, np.ndarray],
        step: int,
    ) -> None:
        """Continue from a saved state: parameters, both moments, that of the filter, and steps taken."""
        self._replace(gaussians, step)
        self.smoothing.restore(smoothing)
        restored = (self.optimizer.moments_1, self.optimizer.moments_2)
        for saved, new in zip(moments, restored, strict=True):
            for name, array in zip(FIELDS, new.arrays, strict=True):
                array.assign(getattr(saved, name))

    def identity(self) -> dict[str, object]:
        """Return what a checkpoint and the run that resumes from it must have in common."""
        return {
            "gaussians at the start": self._start_count,
            "color coefficients": self.gaussians.sh.shape[1],
            "density control": self.config.density.strategy,
            "views": self.views.names,
        }

    @property
    def progress(self) -> float:
        """Share of the run that is over, 0 to 1: of its steps, or of its time where that is scarcer."""
        budget = self.config.stop.time_budget
        of_time = self.seconds / budget if budget is not None else 0.0
        return min(1.0, max(self.optimizer.step / max(1, self.most_steps), of_time))

    @property
    def ended_by(self) -> str:
        """What ends the run; empty while it goes on. The first step is taken in any case."""
        step, budget = self.optimizer.step, self.config.stop.time_budget
        if step >= self.most_steps:
            return "iterations"
        return "time budget" if budget is not None and step > 0 and self.seconds >= budget else ""

    def loss_value(self) -> float:
        """Return the loss of the last step."""
        return self.objective.value()

    def _replace(self, gaussians: Gaussians, step: int) -> None:
        self.gaussians = DeviceGaussians.from_numpy(gaussians, self.config.device)
        self.renderer.set_gaussians(self.gaussians)
        self._build_optimizer(step)

    def _build_optimizer(self, step: int) -> None:
        """Create everything bound to the arrays of the current population, with zero moments."""
        self.renderer.statistics = self.control.statistics if self.control else None
        gradients, rates = self.renderer.gradients, self.config.learning_rates
        self.optimizer = Adam(self.gaussians, gradients, rates, self._extent)
        self.optimizer.step = step
        self.smoothing = SmoothingFilter(self.gaussians, gradients, self.views.cameras)

    def _merge(self) -> None:
        """Merge splats of an object; those of a scene lie farther apart."""
        start = time.perf_counter()
        if self.views.have_masks:
            cameras, held = self.views.cameras, self.optimizer.held
            self.adopt(merged(self.gaussians.to_numpy(), cameras, held))
        self.seconds += time.perf_counter() - start

    def _require_finite(self, view: View) -> None:
        """Raise if the loss or a parameter is not finite; the renderer would just skip such a Gaussian."""
        if self.optimizer.is_finite and self.objective.is_finite:
            return
        # Effective scales are finite even where the learned ones are not.
        values = [array.numpy() for array in self.gaussians.arrays]
        values[FIELDS.index("log_scales")] = self.smoothing.learned.numpy()
        broken = [
            f"{name} of {counted(len(rows), 'Gaussian')} (the first is {rows[0]})"
            for name, value in zip(FIELDS, values, strict=True)
            if len(rows := non_finite_rows(value))
        ]
        raise DigsError(
            f"training diverged at iteration {self.optimizer.step}, view '{view.name}': loss "
            f"{self.loss_value()}, not finite: {', '.join(broken) or 'the loss alone'}. Start again with "
            "a smaller learning_rate (--overwrite); checkpoint.npz, if there, holds the last good state."
        )

    def _view(self) -> View:
        view = self.views.view(self.optimizer.step)
        if self.poses is None:
            return view
        index = self.views.index(self.optimizer.step)
        return replace(view, camera=self.poses.camera(index, view.camera))

    def _move_camera(self, poses: TrainedPoses, view: View) -> None:
        """Move the camera of the last image; after every epoch, put all back where they were on average."""
        step = self.optimizer.step
        images = self.objective.images(view.box)
        depth = self.objective.depth(view.box)
        poses.compare(step, self.views.index(step), view.camera, *images, view.box, depth)
        if (step + 1) % len(self.views) == 0:
            # Bands of the color stay: such a motion turns by hundredths of a degree.
            move_gaussians(self.gaussians, poses.moved_back())

    def _gain(self, view: View) -> ColorGain | None:
        """Return the gain of the photograph that the last image is compared with."""
        if self.exposures is None:
            return None
        index = self.views.index(self.optimizer.step)
        return self.exposures.fit(index, *rendered_samples(self.renderer, view.samples))

    def _depth_errors(self, view: View) -> DepthErrors:
        """Return what is wrong with the measured depth."""
        if self.depth_judge is None or view.depth_samples is None:
            return NO_ERRORS
        index = self.views.index(self.optimizer.step)
        return self.depth_judge.fit(
            index, *rendered_depths(self.renderer.middle, view.depth_samples)
        )

    def _background(self) -> np.ndarray:
        stream = [self.config.seed, BACKGROUND, self.optimizer.step]
        return np.random.default_rng(stream).uniform(size=3)

    def _sh_degree(self) -> int:
        wait = max(1.0, SH_WARM_UP_SHARE * self.config.stop.iterations)
        return min(degree_from_count(self.gaussians.sh.shape[1]), int(self.optimizer.step / wait))
