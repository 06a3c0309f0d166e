"""Adam (Kingma and Ba 2015) for all parameters of the Gaussians, with one rate per group.

Parameters that are no longer finite are noticed when they are written: to read all again would take longer.
"""

import numpy as np
import warp as wp

from digs_warp.device.contiguous import flat, floats_from
from digs_warp.device.parallel import ParallelLaunch, put, run_together, values_per_thread
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.rates import LearningRates, late_decay

wp.set_module_options({"enable_backward": False, "max_unroll": 1})

# Only NaN and infinity have all bits of the exponent set.
_EXPONENT = wp.constant(0x7F800000)


@wp.func
def is_broken(bits: int) -> int:
    """Return 1 for the bits of NaN or infinity, else 0."""
    return wp.where((bits & _EXPONENT) == _EXPONENT, 1, 0)


def non_finite_rows(values: np.ndarray) -> np.ndarray:
    """Return the rows of ``values`` (n, ...) that hold NaN or infinity."""
    finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
    return np.flatnonzero(~finite)


BETA_1 = 0.9
BETA_2 = 0.999
# As in 3DGS: gradients are means over pixels and can be tiny.
EPSILON = 1e-15

# The rate of the centers decays log-linearly to this share of its initial value.
FINAL_MEANS_SHARE = 0.01
# The bands above the base color learn this many times slower.
HIGHER_BANDS_SHARE = 1.0 / 20.0

# A second moment this large makes every step vanish, for more steps than a training has.
HELD = 1e36

# Values that one thread updates on a CPU.
BLOCK = 4096

_BETA_1 = wp.constant(BETA_1)
_BETA_2 = wp.constant(BETA_2)
# Computed in float64: in float32, 1 - 0.999 has a relative error of 5e-5.
_REST_1 = wp.constant(1.0 - BETA_1)
_REST_2 = wp.constant(1.0 - BETA_2)
_EPSILON = wp.constant(EPSILON)
_BLOCK = wp.constant(BLOCK)


@wp.func
def adam_step(
    i: int,
    rate: float,
    correction: float,
    share: wp.array[float],
    gradient: wp.array[float],
    value: wp.array[float],
    moment_1: wp.array[float],
    moment_2: wp.array[float],
) -> int:
    """Update one value; return 1 if it is NaN or infinite then, else 0."""
    g = gradient[i]
    m = _BETA_1 * moment_1[i] + _REST_1 * g
    v = _BETA_2 * moment_2[i] + _REST_2 * g * g
    moment_1[i] = m
    moment_2[i] = v
    updated = value[i] - rate * share[i] * m / (wp.sqrt(v) * correction + _EPSILON)
    value[i] = updated
    return is_broken(wp.cast(updated, wp.int32))


@wp.kernel
def adam_kernel(
    first: int,
    count: int,
    block: int,  # values of a thread, at most `BLOCK`
    period: int,
    # [BLOCK + period] share of the rate that value i % period gets, repeated
    shares: wp.array[float],
    rates: wp.array[float],  # [2] rate / (1 - beta_1^t) and 1 / sqrt(1 - beta_2^t)
    gradients: wp.array[float],
    # outputs
    values: wp.array[float],
    moments_1: wp.array[float],
    moments_2: wp.array[float],
    flag: wp.array[int],  # [1] set to 1 where a value is not finite; all threads write the same
):
    """Update one block of values."""
    begin = (first + wp.tid()) * block
    size = wp.min(block, count - begin)
    share = floats_from(shares, begin % period, size)
    gradient = floats_from(gradients, begin, size)
    value = floats_from(values, begin, size)
    moment_1 = floats_from(moments_1, begin, size)
    moment_2 = floats_from(moments_2, begin, size)
    rate = rates[0]
    correction = rates[1]
    broken = int(0)
    # Only a loop of fixed length becomes vector code.
    if size == _BLOCK:
        for i in range(_BLOCK):
            broken = broken | adam_step(
                i, rate, correction, share, gradient, value, moment_1, moment_2
            )
    else:
        for j in range(size):
            broken = broken | adam_step(
                j, rate, correction, share, gradient, value, moment_1, moment_2
            )
    if broken != 0:
        flag[0] = 1


class Adam:
    """Optimizes ``gaussians`` in place from ``gradients``; counts its steps in ``step``.

    Args:
        gaussians: the parameters.
        gradients: of the loss in them.
        rates: initial learning rates.
        extent: of the scene, the unit of the rate of the centers [m].
    """

    def __init__(
        self,
        gaussians: DeviceGaussians,
        gradients: DeviceGaussians,
        rates: LearningRates,
        extent: float,
    ) -> None:
        self._first_rates = rates
        self.extent = extent
        self.step = 0
        # The flat views below hold addresses only: keep what they point to alive.
        self._kept_alive = (gaussians, gradients)
        self.moments_1 = gaussians.zeros_like()
        self.moments_2 = gaussians.zeros_like()
        device = gaussians.device
        self._rates = [wp.zeros(2, dtype=float, device=device) for _ in gaussians.arrays]
        self._flag = wp.zeros(1, dtype=int, device=device)
        self._launches = []
        block = values_per_thread(device, BLOCK)
        each = (gaussians, gradients, self.moments_1, self.moments_2)
        groups = zip(*(of.arrays for of in each), self._rates, strict=True)
        for value, gradient, first, second, steps in groups:
            arrays = [flat(array) for array in (gradient, value, first, second)]
            count = arrays[0].shape[0]
            pattern = _color_shares(gaussians) if value is gaussians.sh else np.ones(1)
            shares = np.resize(pattern, BLOCK + len(pattern)).astype(np.float32)
            shares = wp.array(shares, dtype=float, device=device)
            inputs = [count, block, len(pattern), shares, steps, *arrays, self._flag]
            blocks = -(-count // block)
            self._launches.append(ParallelLaunch(adam_kernel, blocks, inputs, device, even=True))

    def hold(self, rows: np.ndarray) -> None:
        """Keep the Gaussians at ``rows`` (a bool mask) as they are.

        Adam's steps do not depend on the size of a gradient: what leaks through an opaque surface would move
        a Gaussian behind it as fast as any other. The moments of a Gaussian go where it goes, through density
        control and checkpoints, and so does this.
        """
        for moments in self.moments_2.arrays:
            values = moments.numpy()
            values[rows] = HELD
            moments.assign(values)

    @property
    def held(self) -> np.ndarray:
        """Which Gaussians `hold` keeps, shape (n,), bool."""
        return self.moments_2.opacity_logits.numpy() > 1e-9 * HELD  # it decays

    def rates(self, progress: float) -> list[float]:
        """Return the learning rates of means, scales, quats, opacities and base colors at 0 to 1 of a run."""
        rates = self._first_rates
        share = late_decay(progress)
        falling = [share * r for r in (rates.scales, rates.quats, rates.opacities, rates.colors)]
        return [rates.means * FINAL_MEANS_SHARE**progress * self.extent, *falling]

    @property
    def is_finite(self) -> bool:
        """Whether all parameters were finite after every `update`; waits for the device."""
        return int(self._flag.numpy()[0]) == 0

    def update(self, progress: float) -> None:
        """Take one step along the current gradients; ``progress``: share of the run that is over, 0 to 1."""
        rates = self.rates(progress)
        self.step += 1
        bias_1 = 1.0 - BETA_1**self.step
        bias_2 = 1.0 / np.sqrt(1.0 - BETA_2**self.step)
        for rate, buffer in zip(rates, self._rates, strict=True):
            put(buffer, (rate / bias_1, bias_2))
        run_together(self._launches)


def _color_shares(gaussians: DeviceGaussians) -> np.ndarray:
    """Return the share of the color rate for each value of a Gaussian's ``sh``, shape (3 K,)."""
    shares = np.full(3 * gaussians.sh.shape[1], HIGHER_BANDS_SHARE)
    shares[:3] = 1.0
    return shares
