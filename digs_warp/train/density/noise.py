"""The exploration noise of Markov-chain Monte Carlo training (Kheradmand et al. 2024, equation 8).

Every step moves each center by

    E * NOISE * rate * sigmoid(-STEEPNESS (o - DEAD_OPACITY)) * (Sigma / E^2) eta,   eta ~ N(0, I)

with opacity o, covariance Sigma, and the rate of the centers before it is scaled by the extent E. Only nearly
transparent Gaussians move far, along their own axes. Lengths are in units of E, for which the reference
tuned its factor, so the noise does not depend on the unit of the scene.
"""

import warp as wp

from digs_warp.device.elementary import sigmoid
from digs_warp.splat.footprint import rotation_of
from digs_warp.train.density.relocation import DEAD_OPACITY

wp.set_module_options({"enable_backward": False})

NOISE = 5e5
STEEPNESS = 100.0

_STEEPNESS = wp.constant(STEEPNESS)
_DEAD_OPACITY = wp.constant(DEAD_OPACITY)


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
