"""The filters after matching, from their formulas in float64, pixel by pixel: twins of the fast ones."""

import numpy as np


def twin_spatial(disparity: np.ndarray, alpha: float, delta: float, iterations: int) -> np.ndarray:
    """Return the disparity after librealsense's spatial filter as Intel describes it."""
    values = disparity.astype(np.float64)
    for _ in range(iterations):
        for row in values:
            _average(row, alpha, delta)
            _average(row[::-1], alpha, delta)
        for column in values.T:
            _average(column, alpha, delta)
            _average(column[::-1], alpha, delta)
    return values


def _average(line: np.ndarray, alpha: float, delta: float) -> None:
    """The exponential moving average of a line, in place; it restarts at steps and after holes."""
    for t in range(1, len(line)):
        if abs(line[t] - line[t - 1]) < delta:
            line[t] = alpha * line[t] + (1 - alpha) * line[t - 1]


def twin_filled(disparity: np.ndarray, way: str) -> np.ndarray:
    """Return the disparity with holes filled in reading order from neighbors that have a value by then."""
    values = disparity.astype(np.float64)
    height, width = values.shape
    for y in range(height):
        for x in range(width):
            if not np.isnan(values[y, x]):
                continue
            places = [(y, x - 1)]
            if way != "left":
                places += [(y - 1, x), (y, x + 1), (y + 1, x)]
            inside = [values[j, i] for j, i in places if 0 <= j < height and 0 <= i < width]
            known = [value for value in inside if not np.isnan(value)]
            if known:
                values[y, x] = max(known) if way == "nearest" else min(known)
    return values


def twin_dense(
    disparity: np.ndarray,
    confidence: np.ndarray,
    gray: np.ndarray,
    strength: float,
    contrast: float,
    step: float,
    least_support: float,
    iterations: int = 3,
) -> tuple[np.ndarray, np.ndarray]:
    """Return disparity and confidence after weighted least squares at half size."""
    trust = np.where(np.isnan(disparity), 0.0, confidence.astype(np.float64))
    value = _halves(np.nan_to_num(disparity.astype(np.float64)) * trust)
    support, guide = _halves(trust), _halves(gray.astype(np.float64))
    with np.errstate(invalid="ignore", divide="ignore"):
        matched = value / support
    for t in range(1, iterations + 1):
        share = 1.5 * 4 ** (iterations - t) / (4**iterations - 1) * strength
        for axis in (1, 0):
            images = [np.moveaxis(a, axis, 0) for a in (value, support, guide, matched)]
            for i in range(images[0].shape[1]):
                value_line, support_line, guide_line, matched_line = (a[:, i] for a in images)
                change = np.abs(np.diff(guide_line)) / contrast
                change += np.nan_to_num(np.abs(np.diff(matched_line))) / step
                system = _system(share * np.exp(-change))
                value_line[:] = np.linalg.solve(system, value_line)
                support_line[:] = np.linalg.solve(system, support_line)
    found = support > least_support
    ratio = np.divide(value, support, out=np.zeros_like(value), where=found)
    reached = _doubled(found.astype(np.float64), disparity.shape)
    smooth = _doubled(ratio, disparity.shape) / np.maximum(reached, 0.5)
    spread = np.clip(_doubled(support, disparity.shape), 0, 1)
    keep = reached <= 0.5
    return np.where(keep, disparity, smooth), np.where(keep, trust, spread)


def _system(weight: np.ndarray) -> np.ndarray:
    """The matrix of a line: the identity plus the Laplacian of its couplings."""
    size = len(weight) + 1
    matrix = np.eye(size)
    for i, w in enumerate(weight):
        matrix[i, i] += w
        matrix[i + 1, i + 1] += w
        matrix[i, i + 1] -= w
        matrix[i + 1, i] -= w
    return matrix


def _halves(image: np.ndarray) -> np.ndarray:
    """Means of blocks of 2 x 2 pixels; the last row and column of odd sizes count twice."""
    height, width = image.shape
    even = np.pad(image, ((0, height % 2), (0, width % 2)), mode="edge")
    return (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) / 4


def _doubled(image: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Linear interpolation between the centers of the blocks, constant beyond the first and last."""
    rows, columns = (np.clip((np.arange(n) + 0.5) / 2 - 0.5, 0, None) for n in shape)
    down = np.stack([np.interp(rows, np.arange(len(image)), column) for column in image.T], axis=1)
    return np.stack([np.interp(columns, np.arange(image.shape[1]), row) for row in down])


def twin_temporal(
    frames: list[tuple[np.ndarray, np.ndarray]], alpha: float, delta: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return disparity and confidence of the last frame after librealsense's temporal filter."""
    disparity, confidence = (np.zeros(frames[0][0].shape) for _ in range(2))
    for place in np.ndindex(disparity.shape):
        line = [(float(d[place]), float(c[place])) for d, c in frames]
        known = [(value, trust) for value, trust in line if not np.isnan(value)]
        if np.isnan(line[-1][0]) and len(known) < 2:
            disparity[place] = np.nan
            continue
        average = known[0][0]
        for value, _ in known[1:]:
            near = abs(value - average) < delta
            average = alpha * value + (1 - alpha) * average if near else value
        disparity[place], confidence[place] = average, known[-1][1]
    return disparity, confidence
