"""Random numbers correlated between neighboring pixels: matchers fail in patches, not in single pixels."""

import numpy as np

from digs_warp.sim.sensor.noise_field import white_normal
from digs_warp.sim.sensor.steps import pixels_where

# Patches of a mirror or of glass that show their own texture (dust, a highlight) have about this size [px].
SURFACE_PATCH = 12.0


def coherent_normal(
    rng: np.random.Generator,
    shape: tuple[int, int],
    rows: np.ndarray,
    columns: np.ndarray,
    cell: float,
) -> np.ndarray:
    """Return standard normal values at some pixels of a random field that varies over ``cell`` pixels.

    The field is white on a coarse lattice and interpolated linearly, so a few pixels of a large image
    cost little. Dividing by the norm of the weights keeps the variance at 1 everywhere.

    Args:
        rng: draws the lattice; the same generator state and shape give the same field.
        shape: (height, width) of the image.
        rows: of the pixels, shape (n,), int.
        columns: of the pixels, shape (n,), int.
        cell: distance between the lattice points [px], >= 1.

    Returns:
        Values of mean 0 and variance 1, shape (n,), float32.
    """
    height, width = shape
    # Two points past the last full cell: one for the remainder, one for the random offset.
    across = int(width / cell) + 3
    lattice = white_normal(rng, ((int(height / cell) + 3) * across,))
    offset = rng.random(2)  # otherwise the lattice would not move between frames
    # Weights per row and per column first: there are far fewer of them than pixels.
    top, upper, lower = (np.take(table, rows) for table in _weights(height, cell, offset[0]))
    left, near, far = (np.take(table, columns) for table in _weights(width, cell, offset[1]))
    corner = top * across + left
    after = lattice[1:]
    above = near * np.take(lattice, corner) + far * np.take(after, corner)
    corner += across
    below = near * np.take(lattice, corner) + far * np.take(after, corner)
    return upper * above + lower * below


def _weights(size: int, cell: float, offset: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the lattice point before each of ``size`` pixels, its weight and that of the next point."""
    place = np.arange(size) / cell + offset
    before = place.astype(np.intp)
    share = place - before
    norm = np.hypot(1 - share, share)
    return before, ((1 - share) / norm).astype(np.float32), (share / norm).astype(np.float32)


def coherent_uniform(
    rng: np.random.Generator,
    shape: tuple[int, int],
    rows: np.ndarray,
    columns: np.ndarray,
    cell: float,
) -> np.ndarray:
    """Return values of `coherent_normal` mapped to a uniform distribution from 0 to 1."""
    from scipy.special import ndtr

    return ndtr(coherent_normal(rng, shape, rows, columns, cell))


def keep_patches(rng: np.random.Generator, marked: np.ndarray, share: np.ndarray | float) -> None:
    """Unmark all but a share of the marked pixels of a surface, in patches of SURFACE_PATCH pixels.

    Args:
        rng: draws the patches.
        marked: (height, width), bool; changed in place.
        share: probability that a pixel stays marked, 0 to 1; one number, or one for each marked pixel in
            reading order, (n,).
    """
    rows, columns = pixels_where(marked)
    drawn = coherent_uniform(rng, marked.shape, rows, columns, SURFACE_PATCH)
    marked[rows, columns] = drawn < share
