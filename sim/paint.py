"""Paint tools for the built-in room: noise, shading, frames and lamps on square wall images.

A wall is an array of linear RGB, shape (WALL_SIZE, WALL_SIZE, 3), row 0 on top.
"""

import numpy as np

# A texel at the middle of a wall is as wide as 0.85 of a pixel of the finished panorama.
WALL_SIZE = 768


def noise(rng: np.random.Generator, cells: tuple[int, ...] = (6, 24, 96, 384)) -> np.ndarray:
    """Return fractal noise with standard deviation about 1, shape (WALL_SIZE, WALL_SIZE), float32."""
    total = np.zeros((WALL_SIZE, WALL_SIZE), np.float32)
    for count in cells:
        total += stretch(rng.standard_normal((count + 1, count + 1), dtype=np.float32))
    return total * np.float32(1.5 / np.sqrt(len(cells)))


def stretch(grid: np.ndarray, height: int = WALL_SIZE, width: int = WALL_SIZE) -> np.ndarray:
    """Enlarge a small grid bilinearly."""
    for axis, length in ((0, height), (1, width)):
        position = np.linspace(0, grid.shape[axis] - 1.001, length, dtype=np.float32)
        low = position.astype(np.int32)
        share = (position - low).reshape((-1, 1) if axis == 0 else (1, -1))
        grid = np.take(grid, low, axis) * (1 - share) + np.take(grid, low + 1, axis) * share
    return grid


def plain(color: tuple[float, float, float], shade: np.ndarray) -> np.ndarray:
    """Return a wall of one colour times a shading, (n, n)."""
    return np.asarray(color, np.float32) * np.maximum(shade, 0.05)[..., None]


def fall_off(top: float, bottom: float) -> np.ndarray:
    """Return the light of the room on a wall: from top to bottom, darker in the corners."""
    t = np.linspace(-1, 1, WALL_SIZE, dtype=np.float32)
    corner = 1 - 0.45 * np.abs(t) ** 8
    return (top + (bottom - top) * (t[:, None] + 1) / 2) * corner[:, None] * corner[None, :]


def frame(
    image: np.ndarray, box: tuple[int, int, int, int], color: np.ndarray | float, border: int
) -> np.ndarray:
    """Draw a border round (top, left, height, width), with a soft shadow under it; return the inside."""
    top, left, height, width = box
    image[top : top + height + 2 * border, left : left + width + 2 * border] *= 0.55
    image[top - border : top + height + border, left - border : left + width + border] = color
    return image[top : top + height, left : left + width]


def light_up(canvas: np.ndarray, radiance: np.ndarray) -> None:
    """Fill a canvas, (h, w, 3), with a lamp that fades out to its rim: a hard rim would show steps."""
    t, s = (1 - np.linspace(-1, 1, size) ** 4 for size in canvas.shape[:2])
    canvas[:] = 0.3 + (t[:, None] * s)[..., None] * radiance


def muted(color: np.ndarray) -> np.ndarray:
    """Return a colour halfway to its grey: pigments are less pure than random numbers."""
    return 0.5 * (color + color.mean())
