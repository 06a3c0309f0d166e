"""Adaptive density control of 3D Gaussian splatting (Kerbl et al. 2023, section 5).

A Gaussian with a large gradient on its projected center is too coarse for what it has to show: a small one
is cloned, a large one is split in two. Transparent ones are pruned. From time to time all opacities are
reset to a low value, so that only the Gaussians that the views need come back.
"""

from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians, joined
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.train.config import SPLIT, TrainConfig

# Values of the 3DGS reference. Steps count from 1.
REFINE_EVERY = 100
# Runs of fewer such intervals than this refine more often, but gather gradients for at least this many steps:
# with the reference's interval, 1000 steps have four refinements and 300 have one.
INTERVALS, FEWEST_STEPS = 20, 10
REFINE_FROM = 500
RESET_EVERY = 3000
# The reference refines for the first 15,000 of its 30,000 steps.
REFINE_UNTIL_SHARE = 0.5
# Shorter runs than the reference's start to refine after this share of their steps.
REFINE_FROM_SHARE = 0.1

# Mean norm of dL/d(center) in units of half the image; a Gaussian above it is refined.
GRADIENT_LIMIT = 2e-4
# Largest scale as a share of the scene's extent: a Gaussian up to this size is cloned, a larger one is split.
SMALL_SHARE = 0.01
# A Gaussian above this share is a haze over the image; it is removed after the first opacity reset.
LARGE_SHARE = 0.1
# A split makes this many children, each smaller than its parent by SPLIT_SHRINK.
CHILDREN = 2
SPLIT_SHRINK = 0.8 * CHILDREN
# Below this opacity a Gaussian is removed; a reset leaves at most RESET_OPACITY.
MIN_OPACITY = 0.005
RESET_OPACITY = 0.01


@dataclass(frozen=True, eq=False)
class Refinement:
    """A new population of m Gaussians.

    Attributes:
        gaussians: the raw parameters.
        sources: row of the old population that each Gaussian comes from, shape (m,), int64.
        keeps_moments: whether it also keeps that row's optimizer moments, shape (m,), bool; otherwise they
            start at zero.
        restarted: names of the parameters whose moments are reset to zero for all Gaussians.
    """

    gaussians: Gaussians
    sources: np.ndarray
    keeps_moments: np.ndarray
    restarted: tuple[str, ...] = ()

    def moments(self, name: str, values: np.ndarray) -> np.ndarray:
        """Return the moments of the new population from ``values`` of the old one, float32.

        Args:
            name: the parameter, one of `digs_warp.data.gaussians.FIELDS`.
            values: first or second moments, shape (n, ...).
        """
        moved = values[self.sources]
        moved[slice(None) if name in self.restarted else ~self.keeps_moments] = 0.0
        return moved


def unchanged(gaussians: Gaussians) -> Refinement:
    """Return the same Gaussians, with their moments."""
    count = len(gaussians)
    return Refinement(gaussians, np.arange(count), np.ones(count, dtype=bool))


@dataclass(frozen=True)
class Schedule:
    """When a run of ``iterations`` steps refines and resets."""

    iterations: int

    @property
    def every(self) -> int:
        """Steps between refinements."""
        return min(REFINE_EVERY, max(FEWEST_STEPS, self.iterations // INTERVALS))

    def refines(self, step: int) -> bool:
        """Whether density changes after ``step`` (1, 2, ...)."""
        start = min(REFINE_FROM, REFINE_FROM_SHARE * self.iterations)
        return step % self.every == 0 and start < step <= REFINE_UNTIL_SHARE * self.iterations

    def resets(self, step: int) -> bool:
        """Whether opacities are reset after ``step``: one step after each interval.

        Round step numbers are where views are measured and files are written; these still see the opacities
        as they were before the reset.
        """
        return step % RESET_EVERY == 1 and 1 < step <= REFINE_UNTIL_SHARE * self.iterations


def refine(
    gaussians: Gaussians,
    gradients: np.ndarray,
    *,
    limit: float,
    extent: float,
    max_splats: int,
    remove_large: bool,
    random: np.random.Generator,
) -> Refinement:
    """Clone and split where gradients are large, then remove Gaussians that are transparent or huge.

    Args:
        gaussians: the population, n.
        gradients: mean norm of the gradient of each projected center, shape (n,), 0 where never seen.
        limit: a Gaussian with at least this gradient is refined.
        extent: the scene's extent [m], see `digs_warp.train.views.scene_extent`.
        max_splats: cap of the population; the largest gradients are refined first.
        remove_large: also remove Gaussians larger than LARGE_SHARE of the extent.
        random: draws the positions of a split's children; row i of the draws belongs to Gaussian i.

    Returns:
        Survivors in their old order, then clones, then the children of splits.
    """
    count = len(gaussians)
    largest = gaussians.scales.max(axis=1)
    chosen = _largest(gradients, gradients >= limit, max_splats - count)
    clones = np.flatnonzero(chosen & (largest <= SMALL_SHARE * extent))
    splits = np.flatnonzero(chosen & (largest > SMALL_SHARE * extent))
    stays = np.ones(count, dtype=bool)
    stays[splits] = False
    survivors = np.flatnonzero(stays)
    children = [split_child(gaussians, splits, random) for _ in range(CHILDREN)]
    grown = joined([gaussians.select(survivors), gaussians.select(clones), *children])
    sources = np.concatenate([survivors, clones, *[splits] * CHILDREN])
    keep = grown.opacities >= MIN_OPACITY
    if remove_large:
        keep &= grown.scales.max(axis=1) <= LARGE_SHARE * extent
    if not keep.any():  # an empty scene could never recover
        keep = grown.opacities == grown.opacities.max()
    old = np.arange(len(grown)) < len(survivors)
    return Refinement(grown.select(keep), sources[keep], old[keep])


def split_child(
    gaussians: Gaussians, parents: np.ndarray, random: np.random.Generator
) -> Gaussians:
    """Return one child of each parent, drawn from the parent's own distribution and smaller."""
    draws = random.standard_normal((len(gaussians), 3))[parents]
    chosen = gaussians.select(parents)
    offsets = np.einsum("nij,nj->ni", matrix_from_quat_xyzw(chosen.quats), chosen.scales * draws)
    return replace(
        chosen, means=chosen.means + offsets, log_scales=chosen.log_scales - np.log(SPLIT_SHRINK)
    )


def with_low_opacities(refinement: Refinement) -> Refinement:
    """Lower all opacities to at most RESET_OPACITY and reset their moments to zero."""
    g = refinement.gaussians
    logits = np.minimum(g.opacity_logits, np.log(RESET_OPACITY / (1.0 - RESET_OPACITY)))
    return replace(
        refinement, gaussians=replace(g, opacity_logits=logits), restarted=("opacity_logits",)
    )


def _largest(values: np.ndarray, candidates: np.ndarray, room: int) -> np.ndarray:
    """Return a mask of the ``room`` candidates with the largest values; the first wins a tie."""
    order = np.flatnonzero(candidates)
    order = order[np.argsort(-values[order], kind="stable")][: max(room, 0)]
    chosen = np.zeros(len(values), dtype=bool)
    chosen[order] = True
    return chosen


class DensityControl:
    """How the population changes during a run.

    Args:
        count: Gaussians at the start.
        config: settings.
        extent: of the scene [m].

    Attributes:
        statistics: what the renderer accumulates in every backward pass.

    Raises:
        DigsError: ``count`` is more than the cap allows.
    """

    statistics: SplatStatistics

    def __init__(self, count: int, config: TrainConfig, extent: float) -> None:
        if count > config.density.max_splats:
            raise DigsError(
                f"training: starts with {count:,} Gaussians, but --max-splats allows only "
                f"{config.density.max_splats:,}; raise it, or start with fewer points (a larger --voxel-size)"
            )
        self._config = config
        self._extent = extent
        self._schedule = Schedule(config.stop.iterations)
        self._start_sums(count)

    def after_update(self, gaussians: DeviceGaussians, step: int) -> Refinement | None:
        """Refine, then reset, when it is time; return the new population, None where it stays."""
        refined = self._refined(gaussians, step) if self._schedule.refines(step) else None
        if self._schedule.resets(step):
            refined = with_low_opacities(refined or unchanged(gaussians.to_numpy()))
        return refined

    def _refined(self, gaussians: DeviceGaussians, step: int) -> Refinement:
        refinement = refine(
            gaussians.to_numpy(),
            self._mean_gradients(),
            limit=GRADIENT_LIMIT,
            extent=self._extent,
            max_splats=self._config.density.max_splats,
            remove_large=step > RESET_EVERY,
            random=np.random.default_rng([self._config.seed, SPLIT, step]),
        )
        self._start_sums(len(refinement.gaussians))
        return refinement

    def _start_sums(self, count: int) -> None:
        self.statistics = SplatStatistics.zeros(count, self._config.device)

    def state(self) -> dict[str, np.ndarray]:
        """Return the sums since the last refinement."""
        return {name: array.numpy() for name, array in self._sums().items()}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from the sums in ``state``."""
        self._start_sums(len(state["counts"]))
        for name, array in self._sums().items():
            array.assign(state[name])

    def _sums(self) -> dict[str, wp.array]:
        return {"sums": self.statistics.gradient_sums, "counts": self.statistics.counts}

    def _mean_gradients(self) -> np.ndarray:
        values = {name: array.numpy() for name, array in self._sums().items()}
        return values["sums"] / np.maximum(values["counts"], 1)
