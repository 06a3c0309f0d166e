"""Regularizers of shape and opacity for Monte-Carlo training (Kheradmand et al. 2024).

    L = opacity_weight * mean(o) + scale_weight * mean(s / E)

with opacities o, the three scales s of each Gaussian and the scene's extent E. Gaussians that no view needs
fade and shrink. Scales are in units of E, so the weight does not depend on the unit of the scene.
"""

import numpy as np
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
    sums: wp.array[float],  # [n] both terms of each Gaussian
):
    """Compute the terms of one Gaussian and add their gradient."""
    g = first + wp.tid()
    opacity = 1.0 / (1.0 + wp.exp(-opacity_logits[g]))
    adj_opacity_logits[g] = adj_opacity_logits[g] + opacity_slope * opacity * (1.0 - opacity)
    s = log_scales[g]
    scale = wp.vec3(wp.exp(s[0]), wp.exp(s[1]), wp.exp(s[2]))
    adj_log_scales[g] = adj_log_scales[g] + scale_slope * scale
    sums[g] = opacity_slope * opacity + scale_slope * (scale[0] + scale[1] + scale[2])


class RegularizerLoss:
    """Both terms; adds their gradient with respect to the parameters of n Gaussians to that of the views.

    Args:
        log_scales, opacity_logits: raw parameters, (n,) vec3 and (n,).
        adj_log_scales, adj_opacity_logits: gradients to add to, same shapes.
        opacity_weight, scale_weight: weights of the terms.
        extent: the scene's extent [m].
        threads: CPU threads; 0 means all cores.

    Attributes:
        sums: the array that `value` sums, on the device.
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
        device = str(log_scales.device)
        self.sums = wp.zeros(count, dtype=float, device=device)
        self._launch = ParallelLaunch(
            regularize_kernel,
            count,
            [log_scales, opacity_logits, *slopes, adj_log_scales, adj_opacity_logits, self.sums],
            device,
            threads,
        )

    def run(self) -> None:
        """Compute the terms at the current parameters, and add their gradient."""
        self._launch.run()

    def value(self) -> float:
        """Return the weighted terms of the last `run`; waits for the device."""
        return float(self.sums.numpy().sum(dtype=np.float64))
