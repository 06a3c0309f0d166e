"""How fast the parameters learn, and how their rates fall during a run."""

from dataclasses import astuple, dataclass
from math import cos, log, pi

# Share of their initial values that all rates but those of the centers fall to.
END = 0.05


@dataclass(frozen=True)
class LearningRates:
    """Initial rates: of the means in units of the scene's extent, of the rest in units of the parameter."""

    means: float
    scales: float
    quats: float
    opacities: float
    colors: float

    def scaled(self, factor: float) -> "LearningRates":
        """Return all rates times a factor."""
        return LearningRates(*(factor * rate for rate in astuple(self)))


REFERENCE_RATES = LearningRates(1.6e-4, 5e-3, 1e-3, 5e-2, 2.5e-3)

# Tuned for starts from dense depth: the splats are already in place, and only their shapes and colors are
# left to learn. YCB mustard bottle at 800x450, 38,000 points, opaque start, held-out PSNR after 100 and
# 300 steps: 36.5 and 39.7 dB; with the reference's rates 34.2 and 36.5 dB. 1.5 to 2 times these rates for
# scales and colors change nothing; a decay of shape and color to a tenth from the first step on loses 1.5 dB.
DENSE_RATES = LearningRates(5e-4, 2e-2, 1e-2, 5e-2, 2e-2)

# The reference's rates are for 30,000 steps. In a run of a thirtieth of that, sparse points learn as fast as
# dense ones; in between, by the logarithm. 300 steps from the points of a model, held-out PSNR: a stuffed
# animal 21.5 dB, and 24.1 with these rates and more frequent refinement; a room through a lens, which was
# kept aside, 19.6 and 26.4 dB.
REFERENCE_STEPS, SHORT_STEPS = 30_000, 1_000


def rates_of_sparse_start(steps: int) -> LearningRates:
    """Return the rates of a run of this many steps from sparse points."""
    shortness = log(REFERENCE_STEPS / max(steps, 1)) / log(REFERENCE_STEPS / SHORT_STEPS)
    share = min(max(shortness, 0.0), 1.0)
    pairs = zip(astuple(REFERENCE_RATES), astuple(DENSE_RATES), strict=True)
    return LearningRates(*(slow * (fast / slow) ** share for slow, fast in pairs))


def late_decay(progress: float) -> float:
    """Return the share of a rate at a progress of 0 to 1: 1 for half of it, then half a cosine to `END`.

    What splats learn late is detail, and large steps shake it: see docs/research/training-tried.md.
    """
    late = max(0.0, 2.0 * progress - 1.0)
    return END + (1.0 - END) * 0.5 * (1.0 + cos(pi * late))
