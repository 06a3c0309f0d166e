"""One unknown from one statistic: the figure at which the simulation gives what was measured."""

from collections.abc import Callable

from digs_warp.sim.fit.estimate import Estimate

# Largest image noise that is tried [DN].
MOST_NOISE = 16.0

# Halvings of the range: the last one is finer than the error of any statistic.
HALVINGS = 7


def solve(
    statistic: Callable[[float], float], wanted: Estimate, between: tuple[float, float]
) -> Estimate:
    """Return where a rising statistic has the wanted value, by halving; an end where it never has.

    Args:
        statistic: of the simulation, for a value of the figure.
        wanted: what was measured.
        between: the smallest and the largest value of the figure.
    """
    low, high = between
    at_low, at_high = statistic(low), statistic(high)
    if wanted.value <= at_low:
        return Estimate(low, _distance_of(wanted.error, low, high, at_low, at_high))
    if wanted.value >= at_high:
        return Estimate(high, _distance_of(wanted.error, low, high, at_low, at_high))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        value = statistic(middle)
        if value < wanted.value:
            low, at_low = middle, value
        else:
            high, at_high = middle, value
    share = (wanted.value - at_low) / (at_high - at_low)
    return Estimate(
        low + share * (high - low), _distance_of(wanted.error, low, high, at_low, at_high)
    )


def _distance_of(error: float, low: float, high: float, at_low: float, at_high: float) -> float:
    """Return the error of the figure that the error of the statistic amounts to."""
    return abs(error * (high - low) / (at_high - at_low)) if at_high != at_low else float("inf")
