"""Float64 twin of one level of the plane sweep: whole windows, one inverse depth after the other."""

import numpy as np
from scipy.ndimage import map_coordinates

from digs_warp.init.plane_sweep import NO_SCORE, NOISE, SCORE_RADIUS, WINDOW_RADIUS


def means(values: np.ndarray, radius: int) -> np.ndarray:
    """Return the mean of the square around each pixel that has a whole one, (h - 2 r, w - 2 r)."""
    size = 2 * radius + 1
    windows = np.lib.stride_tricks.sliding_window_view(values, (size, size))
    return windows.mean(axis=(2, 3))


def sweep_twin(
    reference: np.ndarray,
    others: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
    starts: np.ndarray,
    step: float,
    count: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return best inverse depths, their scores, and all scores, (h, w), (h, w) and (count, h, w).

    ``others``: gray image, A (3, 3) and b (3,) of each neighbor; ``starts``: first inverse depth, (h, w).
    """
    height, width = reference.shape
    halo = WINDOW_RADIUS + SCORE_RADIUS
    rows = np.clip(np.arange(-halo, height + halo), 0, height - 1)
    columns = np.clip(np.arange(-halo, width + halo), 0, width - 1)
    x, y = np.meshgrid(columns.astype(float), rows.astype(float))
    r, q0 = (image[np.ix_(rows, columns)].astype(float) for image in (reference, starts))
    r_mean = means(r, WINDOW_RADIUS)
    r_spread = means(r * r, WINDOW_RADIUS) - r_mean**2 + NOISE
    scores = []
    for number in range(count):
        matches = []
        for image, turned, shift in others:
            to = turned @ np.stack([x, y, np.ones_like(x)]).reshape(3, -1)
            to = to.reshape(3, *x.shape) + (q0 + number * step) * shift[:, None, None]
            places = np.stack([to[1], to[0]]) / to[2]
            s = map_coordinates(image.astype(float), places, order=1, mode="nearest")
            s_mean = means(s, WINDOW_RADIUS)
            s_spread = means(s * s, WINDOW_RADIUS) - s_mean**2 + NOISE
            covariance = means(r * s, WINDOW_RADIUS) - r_mean * s_mean
            matches.append(covariance / np.sqrt(r_spread * s_spread))
        ordered = -np.sort(-np.stack(matches), axis=0)
        better = ordered[: (len(others) + 1) // 2]
        scores.append(means(better.mean(axis=0), SCORE_RADIUS))
    every = np.stack(scores)
    best = every.argmax(axis=0)
    inner = np.clip(best, 1, count - 2)
    before, top, after = (np.take_along_axis(every, (inner + k)[None], 0)[0] for k in (-1, 0, 1))
    is_inner = best == inner
    shift = np.where(is_inner, 0.5 * (before - after) / (before - 2 * top + after), 0.0)
    return starts + (best + shift) * step, np.where(is_inner, top, NO_SCORE), every
