"""Gaussian splatting as Markov chain Monte Carlo (Kheradmand et al. 2024): relocation and noise.

Legend: o, s opacity and scales of one Gaussian; N the number of copies that replace it at the same place.
Copies with

    o' = 1 - (1 - o)^(1/N)
    s' = s o / sum_{i=1..N} sum_{k=0..i-1} C(i-1, k) (-1)^k o'^(k+1) / sqrt(k+1)

together look like the original (the paper's equation 9). Summed over i first, C(i-1, k) becomes C(N, k+1).

The exploration noise of Markov-chain Monte Carlo training (Kheradmand et al. 2024, equation 8).

Every step moves each center by

    E * NOISE * rate * sigmoid(-STEEPNESS (o - DEAD_OPACITY)) * (Sigma / E^2) eta,   eta ~ N(0, I)

with opacity o, covariance Sigma, and the rate of the centers before it is scaled by the extent E. Only nearly
transparent Gaussians move far, along their own axes. Lengths are in units of E, for which the reference
tuned its factor, so the noise does not depend on the unit of the scene.
"""

from dataclasses import replace
from math import comb

import numpy as np
import warp as wp

from digs_warp.data.gaussians import Gaussians
from digs_warp.device.elementary import sigmoid
from digs_warp.splat.footprint import rotation_of
from digs_warp.train.density.refinement import Refinement

wp.set_module_options({"enable_backward": False})

# A Gaussian below this opacity is dead: it is relocated to where it helps.
DEAD_OPACITY = 0.005
# The population grows by this share at each refinement, up to its cap.
GROWTH = 0.05
# The reference refines up to step 25,000 of its 30,000.
RELOCATE_UNTIL_SHARE = 25.0 / 30.0
# Most copies at one place, as in gsplat: with more, the binomials would lose all precision.
MAX_COPIES = 51

# The opacities of copies stay within these bounds, so that their logits are finite.
_MAX_OPACITY = 1.0 - 1e-6

_TERMS = np.arange(MAX_COPIES)
_BINOMIALS = np.array(
    [[float(comb(n, k + 1)) for k in range(MAX_COPIES)] for n in range(MAX_COPIES + 1)]
)


NOISE = 5e5
STEEPNESS = 100.0
_STEEPNESS = wp.constant(STEEPNESS)
_DEAD_OPACITY = wp.constant(DEAD_OPACITY)


def shared_by_copies(
    opacities: np.ndarray, scales: np.ndarray, copies: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return opacity (n,) and scales (n, 3) of each of ``copies`` equal Gaussians that replace one.

    Args:
        opacities: in (0, 1], shape (n,).
        scales: standard deviations [m], shape (n, 3).
        copies: 1 to MAX_COPIES, shape (n,), int; more count as MAX_COPIES.
    """
    copies = np.minimum(copies, MAX_COPIES)
    opacities = np.clip(opacities.astype(np.float64), DEAD_OPACITY, _MAX_OPACITY)
    each = -np.expm1(np.log1p(-opacities) / copies)
    signs = np.where(_TERMS % 2 == 0, 1.0, -1.0) / np.sqrt(_TERMS + 1.0)
    powers = each[:, None] ** (_TERMS + 1)
    brightness = (_BINOMIALS[copies] * signs * powers).sum(axis=1)
    return np.clip(each, DEAD_OPACITY, _MAX_OPACITY), scales * (opacities / brightness)[:, None]


def relocate(
    gaussians: Gaussians, max_splats: int, random: np.random.Generator
) -> Refinement | None:
    """Move dead Gaussians onto living ones and add new ones there, sampled in proportion to opacity.

    Args:
        gaussians: the population, n.
        max_splats: cap of the population.
        random: the generator; row i of its draws belongs to Gaussian i, old or new.

    Returns:
        The n old ones in their order, then the new ones; None when nothing lives or nothing changes.
    """
    count = len(gaussians)
    opacities = gaussians.opacities.astype(np.float64)
    alive = opacities > DEAD_OPACITY
    newcomers = max(min(max_splats, int(count * (1.0 + GROWTH))) - count, 0)
    if not alive.any() or (alive.all() and not newcomers):
        return None
    steps = np.cumsum(np.where(alive, opacities, 0.0))
    draws = random.random(count + newcomers)
    hosts = np.searchsorted(steps, draws * steps[-1], side="right")
    # Rounding can put the last draw past the end, or on a dead Gaussian after the last living one.
    hosts = np.minimum(hosts, np.flatnonzero(alive)[-1])
    moving = np.concatenate([~alive, np.ones(newcomers, dtype=bool)])
    sources = np.where(moving, hosts, np.arange(count + newcomers))
    copies = np.bincount(sources, minlength=count)
    shared = np.flatnonzero(copies > 1)
    logits, log_scales = gaussians.opacity_logits.copy(), gaussians.log_scales.copy()
    each, scales = shared_by_copies(
        opacities[shared], gaussians.scales[shared].astype(np.float64), copies[shared]
    )
    logits[shared], log_scales[shared] = np.log(each) - np.log1p(-each), np.log(scales)
    moved = replace(gaussians, log_scales=log_scales, opacity_logits=logits).select(sources)
    # The moments of a changed Gaussian no longer describe it.
    return Refinement(moved, sources, copies[sources] == 1)


@wp.kernel
def noise_kernel(
    first: int,
    log_scales: wp.array[wp.vec3],  # [n]
    quats: wp.array[wp.vec4],  # [n]
    opacity_logits: wp.array[float],  # [n]
    draws: wp.array[wp.vec3],  # [n] eta
    factors: wp.array[float],  # [2] NOISE * rate / E, and E
    # outputs
    means: wp.array[wp.vec3],  # [n]
):
    """Move one center."""
    g = first + wp.tid()
    rotation = rotation_of(quats[g])
    # A Gaussian larger than the scene has nothing to explore, and its square could overflow.
    largest = wp.log(factors[1])
    scale = wp.vec3(
        wp.exp(wp.min(log_scales[g][0], largest)),
        wp.exp(wp.min(log_scales[g][1], largest)),
        wp.exp(wp.min(log_scales[g][2], largest)),
    )
    local = wp.cw_mul(wp.cw_mul(scale, scale), wp.transpose(rotation) * draws[g])
    share = sigmoid(-_STEEPNESS * (sigmoid(opacity_logits[g]) - _DEAD_OPACITY))
    means[g] = means[g] + factors[0] * share * (rotation * local)
