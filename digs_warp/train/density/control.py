"""One interface for the density strategies, made from the settings, and their cap on Gaussians."""

import numpy as np
import warp as wp

from digs_warp.checks import DigsError
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.sh import coefficient_count
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.train.config import EXPLORE, RELOCATE, SPLIT, TrainConfig
from digs_warp.train.density import adaptive
from digs_warp.train.density.mcmc import NOISE, RELOCATE_UNTIL_SHARE, noise_kernel, relocate
from digs_warp.train.density.refinement import Refinement, unchanged

# Floats per Gaussian without its color: center, scales, rotation, opacity.
_SHAPE_FLOATS = 3 + 3 + 4 + 1
# Each parameter has a value, a gradient and two moments.
_COPIES = 4
# The renderer's lists: 12 floats and eight integers per splat, and about three (tile, splat) pairs of nine
# gradients and two integers each, with spare capacity to grow into.
_LIST_BYTES = 4 * (12 + 8) + 4 * 3 * (9 + 2) * 3 // 2

_MEGABYTE = 2**20


def bytes_per_splat(sh_degree: int) -> int:
    """Return the memory [bytes] that one Gaussian takes during training, without images."""
    floats = _SHAPE_FLOATS + 3 * coefficient_count(sh_degree)
    return 4 * _COPIES * floats + _LIST_BYTES


def splat_cap(max_splats: int, memory_budget: float | None, sh_degree: int) -> int:
    """Return the smaller of ``max_splats`` and what fits into ``memory_budget`` [MiB]; None: no budget."""
    if memory_budget is None:
        return max_splats
    return min(max_splats, int(memory_budget * _MEGABYTE) // bytes_per_splat(sh_degree))


def check_start(count: int, cap: int) -> None:
    """Raise a `DigsError` when a run starts with more Gaussians than it may hold."""
    if count > cap:
        raise DigsError(
            f"training: starts with {count:,} Gaussians, but --max-splats and splat_memory allow only "
            f"{cap:,}; raise them, or start with fewer points (a larger --voxel-size)"
        )


class DensityControl:
    """How the population changes during a run. This one keeps it as it is: enough for a dense start.

    Attributes:
        statistics: what the renderer accumulates in every backward pass; None for nothing.
    """

    statistics: SplatStatistics | None = None

    def after_update(
        self, gaussians: DeviceGaussians, step: int, means_rate: float
    ) -> Refinement | None:
        """Update the population after an optimizer step.

        Args:
            gaussians: may be changed in place.
            step: steps taken so far: 1, 2, ...
            means_rate: the current rate of the centers, in units of the scene's extent.

        Returns:
            The new population, or None when it stays the same.
        """
        return None

    def state(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint has to hold; draws follow from (seed, step)."""
        return {}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a `state`."""


class Adaptive(DensityControl):
    """Clone, split, prune and reset; see `digs_warp.train.density.adaptive`."""

    def __init__(
        self, count: int, config: TrainConfig, extent: float, max_splats: int, absolute: bool
    ) -> None:
        self._absolute = absolute
        self._config = config
        self._extent = extent
        self._max_splats = max_splats
        self._schedule = adaptive.Schedule(config.stop.iterations)
        self._start_sums(count)

    def after_update(
        self, gaussians: DeviceGaussians, step: int, means_rate: float
    ) -> Refinement | None:
        """Refine, then reset, when it is time."""
        refined = self._refined(gaussians, step) if self._schedule.refines(step) else None
        if self._schedule.resets(step):
            refined = adaptive.with_low_opacities(refined or unchanged(gaussians.to_numpy()))
        return refined

    def _refined(self, gaussians: DeviceGaussians, step: int) -> Refinement:
        refinement = adaptive.refine(
            gaussians.to_numpy(),
            self._mean_gradients(),
            limit=adaptive.ABSOLUTE_GRADIENT_LIMIT if self._absolute else adaptive.GRADIENT_LIMIT,
            extent=self._extent,
            max_splats=self._max_splats,
            remove_large=step > adaptive.RESET_EVERY,
            random=np.random.default_rng([self._config.seed, SPLIT, step]),
        )
        self._start_sums(len(refinement.gaussians))
        return refinement

    def _start_sums(self, count: int) -> None:
        self.statistics = SplatStatistics.zeros(count, self._config.device, absolute=self._absolute)

    def state(self) -> dict[str, np.ndarray]:
        """Return the sums since the last refinement."""
        return {name: array.numpy() for name, array in self._sums().items()}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from the sums in ``state``."""
        self._start_sums(len(state["counts"]))
        for name, array in self._sums().items():
            array.assign(state[name])

    def _sums(self) -> dict[str, wp.array]:
        statistics = self.statistics
        assert statistics is not None
        sums = statistics.absolute_sums if self._absolute else statistics.gradient_sums
        return {"sums": sums, "counts": statistics.counts}

    def _mean_gradients(self) -> np.ndarray:
        values = {name: array.numpy() for name, array in self._sums().items()}
        return values["sums"] / np.maximum(values["counts"], 1)


class MonteCarlo(DensityControl):
    """Explore with noise, relocate the dead, grow to the cap; see `digs_warp.train.density.mcmc`."""

    def __init__(self, config: TrainConfig, extent: float, max_splats: int) -> None:
        self._config = config
        self._extent = extent
        self._max_splats = max_splats
        self._schedule = adaptive.Schedule(
            config.stop.iterations, RELOCATE_UNTIL_SHARE, often=False
        )

    def after_update(
        self, gaussians: DeviceGaussians, step: int, means_rate: float
    ) -> Refinement | None:
        """Add noise; relocate when it is time."""
        self._explore(gaussians, step, means_rate)
        if not self._schedule.refines(step):
            return None
        random = np.random.default_rng([self._config.seed, RELOCATE, step])
        return relocate(gaussians.to_numpy(), self._max_splats, random)

    def _explore(self, gaussians: DeviceGaussians, step: int, means_rate: float) -> None:
        random = np.random.default_rng([self._config.seed, EXPLORE, step])
        draws = random.standard_normal((len(gaussians), 3), dtype=np.float32)
        factors = np.array([NOISE * means_rate / self._extent, self._extent], dtype=np.float32)
        device = gaussians.device
        inputs = [
            gaussians.log_scales,
            gaussians.quats,
            gaussians.opacity_logits,
            wp.array(draws, dtype=wp.vec3, device=device),
            wp.array(factors, dtype=float, device=device),
            gaussians.means,
        ]
        launch_parallel(noise_kernel, len(gaussians), inputs, device)


def density_control(
    count: int, sh_degree: int, config: TrainConfig, extent: float
) -> DensityControl:
    """Return the strategy that ``config`` names, for a run that starts with ``count`` Gaussians.

    Raises:
        DigsError: ``count`` is more than the cap allows.
    """
    density = config.density
    if density.strategy == "fixed":
        return DensityControl()
    cap = splat_cap(density.max_splats, density.splat_memory, sh_degree)
    check_start(count, cap)
    if density.strategy == "mcmc":
        return MonteCarlo(config, extent, cap)
    return Adaptive(count, config, extent, cap, absolute=density.strategy == "absgrad")
