"""What `digs_warp.sim.sensor.color.pixel_loops` does in one pass, an operation at a time in NumPy."""

import numpy as np


def with_noise(
    linear: np.ndarray,
    sigma: tuple[float, float, float],
    normal: np.ndarray,
    is_shot: bool,
) -> np.ndarray:
    """Return the image plus its normal noise, both (height, width, 3), float32."""
    noise = normal * np.array(sigma, np.float32)
    if is_shot:
        noise = noise * np.sqrt(np.maximum(linear, 0))
    return linear + noise


def times_gain(linear: np.ndarray, gain: tuple[float, float, float], clipped: float) -> np.ndarray:
    """Return the image times its gains, at most 1; what is ``clipped`` stays."""
    product = np.minimum(linear * np.array(gain, np.float32), np.float32(1))
    return np.where(linear >= np.float32(clipped), linear, product)


def looked_up(linear: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Return the nearest entry of the table for each value."""
    steps = np.clip(linear, 0, 1) * np.float32(len(table) - 1) + np.float32(0.5)
    return table[steps.astype(np.int64)]
