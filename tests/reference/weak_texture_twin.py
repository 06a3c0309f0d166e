"""Texture, coarse fields and the failures of weak texture in float64 (`sim/sensor/row_field.py`)."""

import numpy as np


def gradient_of(gray: np.ndarray) -> np.ndarray:
    """Central differences along rows [DN/px]; the image is mirrored round its first and last pixel."""
    mirrored = np.pad(
        gray.astype(np.float64), ((0, 0), (1, 1)), mode="reflect" if gray.shape[1] > 1 else "edge"
    )
    return (mirrored[:, 2:] - mirrored[:, :-2]) / 2


def windowed_rms(gradient: np.ndarray, window: int) -> np.ndarray:
    """Root of the mean square in windows; the border is repeated."""
    squares = np.pad(gradient**2, window // 2, mode="edge")
    views = np.lib.stride_tricks.sliding_window_view(squares, (window, window))
    return np.sqrt(views.mean(axis=(2, 3)))


def block_means(values: np.ndarray, size: int) -> np.ndarray:
    """Means of blocks of ``size`` x ``size`` pixels; the last ones of a row or column have fewer."""
    rows, columns = range(0, values.shape[0], size), range(0, values.shape[1], size)
    return np.array([[values[y : y + size, x : x + size].mean() for x in columns] for y in rows])


def cubic_spline(distance: np.ndarray) -> np.ndarray:
    """The cubic B-spline of unit step round 0."""
    r = np.abs(distance)
    near = 2 / 3 - r**2 + r**3 / 2
    return np.where(r < 1, near, np.where(r < 2, (2 - r) ** 3 / 6, 0.0))


def spline_weights(size: int, step: float, offset: float, points: int) -> np.ndarray:
    """Weights (size, points) of B-splines on points of which the second is ``offset`` before place 0."""
    places = np.arange(size)[:, None] / step + offset + 1
    weights = cubic_spline(places - np.arange(points))
    return weights / np.linalg.norm(weights, axis=1, keepdims=True)


def linear_weights(size: int, step: float, cells: int) -> np.ndarray:
    """Weights (size, cells) of linear interpolation between the middles of cells."""
    middles = (np.arange(cells) + 0.5) * step
    place = np.arange(size) + 0.5
    return np.stack([np.interp(place, middles, row) for row in np.eye(cells)], axis=1)


def weak_texture(
    disparity: np.ndarray,
    fields: dict[str, np.ndarray],
    strip_error: float,
    strip_growth: float,
    label_from: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return disparity, what has failed, and what of it has no value, from the fields at every pixel."""
    noise = fields["noise"] * fields["sigma"]
    excess = fields["strips"] - fields["wrong_level"]
    in_strip = excess > 0
    value = np.where(in_strip, disparity - strip_error - strip_growth * excess, disparity + noise)
    lost = in_strip & (fields["strips"] > fields["lost_level"])
    lost |= fields["patches"] > fields["patch_level"]
    failed = (in_strip | lost | (np.abs(noise) > label_from)) & ~np.isnan(disparity)
    return np.where(lost, np.nan, value), failed, failed & lost
