# type: ignore
# (device code, which Warp's stubs do not type)
"""Adam (Kingma and Ba 2015) over all parameters of the Gaussians, with one rate per group."""

import numpy as np
import warp as wp

from digs_warp.parallel import ParallelLaunch
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.config import TrainConfig

wp.set_module_options({"enable_backward": False, "max_unroll": 1, "optimization_level": 3})

BETA_1 = 0.9
BETA_2 = 0.999
# As in 3DGS: gradients are means over pixels and may be tiny.
EPSILON = 1e-15

# The rate of the centres falls log-linearly to this share of its start.
FINAL_MEANS_SHARE = 0.01
# Bands above the base colour learn this much slower.
HIGHER_BANDS_SHARE = 1.0 / 20.0

_BETA_1 = wp.constant(BETA_1)
_BETA_2 = wp.constant(BETA_2)
# Taken in float64: in float32, 1 - 0.999 is wrong by 5e-5 of itself.
_REST_1 = wp.constant(1.0 - BETA_1)
_REST_2 = wp.constant(1.0 - BETA_2)
_EPSILON = wp.constant(EPSILON)
_BLOCK = wp.constant(4096)


@wp.kernel
def adam_kernel(
    first: int,
    count: int,
    stride: int,  # of every `stride` values ...
    head: int,  # ... the first `head` take rates[0], the others rates[1]
    rates: wp.array[float],  # [3] both rates / (1 - beta_1^t), then 1 / sqrt(1 - beta_2^t)
    gradients: wp.array[float],
    # outputs
    values: wp.array[float],
    moments_1: wp.array[float],
    moments_2: wp.array[float],
):
    """Update one block of values."""
    begin = (first + wp.tid()) * _BLOCK
    for i in range(begin, wp.min(begin + _BLOCK, count)):
        g = gradients[i]
        m = _BETA_1 * moments_1[i] + _REST_1 * g
        v = _BETA_2 * moments_2[i] + _REST_2 * g * g
        moments_1[i] = m
        moments_2[i] = v
        rate = wp.where(i % stride < head, rates[0], rates[1])
        values[i] = values[i] - rate * m / (wp.sqrt(v) * rates[2] + _EPSILON)


def _flat(array: wp.array) -> wp.array:
    """Return the same memory as a flat array of floats."""
    count = array.size * (np.prod(array.dtype._shape_) if hasattr(array.dtype, "_shape_") else 1)
    return wp.array(ptr=array.ptr, dtype=float, shape=int(count), device=array.device)


class Adam:
    """Optimizes ``gaussians`` in place from ``gradients``; counts its steps in ``step``."""

    def __init__(
        self,
        gaussians: DeviceGaussians,
        gradients: DeviceGaussians,
        config: TrainConfig,
        extent: float,
        threads: int = 0,
    ) -> None:
        self.config = config
        self.extent = extent
        self.step = 0
        # The flat views below hold addresses only: keep what they point to alive.
        self._kept_alive = (gaussians, gradients)
        self.moments_1 = gaussians.zeros_like()
        self.moments_2 = gaussians.zeros_like()
        device = gaussians.device
        self._rates = [wp.zeros(3, dtype=float, device=device) for _ in gaussians.arrays]
        bands = 3 * gaussians.sh.shape[1]
        self._launches = []
        groups = zip(
            gaussians.arrays,
            gradients.arrays,
            self.moments_1.arrays,
            self.moments_2.arrays,
            self._rates,
            strict=True,
        )
        for value, gradient, first, second, rates in groups:
            flat = [_flat(array) for array in (gradient, value, first, second)]
            count = flat[0].shape[0]
            stride, head = (bands, 3) if value is gaussians.sh else (1, 1)
            self._launches.append(
                ParallelLaunch(
                    adam_kernel,
                    -(-count // 4096),
                    [count, stride, head, rates, *flat],
                    device,
                    threads,
                )
            )

    def rates(self) -> list[tuple[float, float]]:
        """Return the learning rates (base, higher bands) of means, scales, quats, opacities, colours."""
        c = self.config
        progress = min(1.0, self.step / max(1, c.iterations))
        means = c.means_rate * self.extent * FINAL_MEANS_SHARE**progress
        plain = [(rate, rate) for rate in (means, c.scales_rate, c.quats_rate, c.opacities_rate)]
        return [*plain, (c.colors_rate, c.colors_rate * HIGHER_BANDS_SHARE)]

    def update(self) -> None:
        """Take one step along the present gradients."""
        rates = self.rates()
        self.step += 1
        bias_1 = 1.0 - BETA_1**self.step
        bias_2 = 1.0 / np.sqrt(1.0 - BETA_2**self.step)
        for (base, higher), buffer, launch in zip(rates, self._rates, self._launches, strict=True):
            buffer.assign(np.array([base / bias_1, higher / bias_1, bias_2], dtype=np.float32))
            launch.run()
