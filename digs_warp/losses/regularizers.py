# type: ignore
# (device code, which Warp's stubs do not type)
"""Regularizers of shape and opacity, as Monte-Carlo training needs them (Kheradmand et al. 2024).

    L = opacity_weight * mean(o) + scale_weight * mean(s / E)

with opacities o, the three scales s of each Gaussian and the scene's extent E: what no view needs fades and
shrinks. Scales are taken in units of E, so that the weight does not depend on the unit of the scene.
"""

import warp as wp

from digs_warp.device.parallel import ParallelLaunch

wp.set_module_options({"enable_backward": False})


@wp.kernel
def regularize_kernel(
    first: int,
    log_scales: wp.array[wp.vec3],  # [n]
    opacity_logits: wp.array[float],  # [n]
    opacity_slope: float,  # opacity_weight / n
    scale_slope: float,  # scale_weight / (3 n E)
    # outputs
    adj_log_scales: wp.array[wp.vec3],  # added to
    adj_opacity_logits: wp.array[float],  # added to
):
    """Add the gradient of one Gaussian."""
    g = first + wp.tid()
    opacity = 1.0 / (1.0 + wp.exp(-opacity_logits[g]))
    adj_opacity_logits[g] = adj_opacity_logits[g] + opacity_slope * opacity * (1.0 - opacity)
    s = log_scales[g]
    scale = wp.vec3(wp.exp(s[0]), wp.exp(s[1]), wp.exp(s[2]))
    adj_log_scales[g] = adj_log_scales[g] + scale_slope * scale


class Regularizer:
    """Adds the gradient of both terms to the gradients of n Gaussians.

    Args:
        log_scales, opacity_logits: raw parameters, (n,) vec3 and (n,).
        adj_log_scales, adj_opacity_logits: gradients to add to, same shapes.
        opacity_weight, scale_weight: factors of the terms.
        extent: the scene's extent [m].
        threads: CPU threads; 0 means all cores.
    """

    def __init__(
        self,
        log_scales: wp.array,
        opacity_logits: wp.array,
        adj_log_scales: wp.array,
        adj_opacity_logits: wp.array,
        *,
        opacity_weight: float,
        scale_weight: float,
        extent: float,
        threads: int = 0,
    ) -> None:
        count = len(log_scales)
        slopes = [opacity_weight / count, scale_weight / (3 * count * extent)]
        self._launch = ParallelLaunch(
            regularize_kernel,
            count,
            [log_scales, opacity_logits, *slopes, adj_log_scales, adj_opacity_logits],
            str(log_scales.device),
            threads,
        )

    def run(self) -> None:
        """Add the gradient at the present parameters."""
        self._launch.run()
