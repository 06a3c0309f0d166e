"""Float64 twin of Adam, from the paper (Kingma and Ba 2015, algorithm 1)."""

import numpy as np


def adam_twin(value: np.ndarray, gradients: list[np.ndarray], rates: list[float]) -> np.ndarray:
    """Return the value after one step per gradient."""
    value = value.astype(np.float64)
    first, second = np.zeros_like(value), np.zeros_like(value)
    for step, (gradient, rate) in enumerate(zip(gradients, rates, strict=True), start=1):
        first = 0.9 * first + 0.1 * gradient
        second = 0.999 * second + 0.001 * gradient**2
        mean = first / (1 - 0.9**step)
        variance = second / (1 - 0.999**step)
        value = value - rate * mean / (np.sqrt(variance) + 1e-15)
    return value
