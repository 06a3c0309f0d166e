"""Slopes of disparity along an axis, pixel by pixel; see sim.sensor.slopes."""

import numpy as np


def slopes_twin(disparity: np.ndarray, axis: int) -> np.ndarray:
    """Return the smaller difference to the neighbors along an axis, 0 where there is none."""
    lines = np.moveaxis(disparity, axis, 1)
    slopes = np.zeros_like(lines)
    for line, out in zip(lines, slopes, strict=True):
        for i in range(len(line)):
            back = line[i] - line[i - 1] if i > 0 else None
            forth = line[i + 1] - line[i] if i + 1 < len(line) else None
            both = [step for step in (forth, back) if step is not None]
            if len(both) == 2 and not abs(both[1]) < abs(both[0]):
                both = both[:1]
            slope = both[-1] if both else 0.0
            out[i] = 0.0 if np.isnan(slope) else slope
    return np.moveaxis(slopes, 1, axis)
