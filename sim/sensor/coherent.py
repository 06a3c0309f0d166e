"""Random numbers that neighbouring pixels share: matchers fail in patches, not in single pixels."""

import numpy as np


def coherent_normal(
    rng: np.random.Generator,
    shape: tuple[int, int],
    rows: np.ndarray,
    columns: np.ndarray,
    cell: float,
) -> np.ndarray:
    """Return standard normal values at some pixels of a random field that varies over ``cell`` pixels.

    The field is white on a coarse lattice and interpolated linearly, so that a few pixels of a large
    image cost little. Dividing by the norm of the weights keeps the variance at 1 everywhere.

    Args:
        rng: draws the lattice; the same generator state and shape give the same field.
        shape: (height, width) of the image.
        rows: of the wanted pixels, shape (n,), int.
        columns: of the wanted pixels, shape (n,), int.
        cell: distance of the lattice points [px], >= 1.

    Returns:
        Values of mean 0 and variance 1, shape (n,), float64.
    """
    height, width = shape
    # Two points past the last full cell: one for the remainder, one for the random offset.
    lattice = rng.standard_normal((int(height / cell) + 3, int(width / cell) + 3))
    offset = rng.random(2)  # else the lattice would stand still from frame to frame
    y, x = rows / cell + offset[0], columns / cell + offset[1]
    top, left = y.astype(np.intp), x.astype(np.intp)
    down, right = y - top, x - left
    field = (1 - down) * (1 - right) * lattice[top, left]
    field += (1 - down) * right * lattice[top, left + 1]
    field += down * (1 - right) * lattice[top + 1, left]
    field += down * right * lattice[top + 1, left + 1]
    norm = np.hypot(1 - down, down) * np.hypot(1 - right, right)
    return field / norm


def coherent_uniform(
    rng: np.random.Generator,
    shape: tuple[int, int],
    rows: np.ndarray,
    columns: np.ndarray,
    cell: float,
) -> np.ndarray:
    """Return values of `coherent_normal` mapped to a uniform distribution over 0 to 1."""
    from scipy.special import ndtr

    return ndtr(coherent_normal(rng, shape, rows, columns, cell))
