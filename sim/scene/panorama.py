"""Directions and solid angles of the pixels of an equirectangular panorama.

Row 0 looks straight up (+z), and the middle column looks along +x. Seen from inside, going right in the
image turns clockwise from above, so writing on the walls is not mirrored:
``u = 0.5 - atan2(y, x) / (2 pi)``, ``v = acos(z) / pi``.
"""

import numpy as np


def panorama_directions(width: int, height: int) -> np.ndarray:
    """Return the unit direction of each panorama pixel's center, shape (height, width, 3)."""
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    polar = ((np.arange(height) + 0.5) / height * np.pi)[:, None]
    ring = np.sin(polar)
    return np.stack(
        [ring * np.cos(azimuth), ring * np.sin(azimuth), np.cos(polar) + 0 * azimuth], axis=-1
    )


def solid_angles(width: int, height: int) -> np.ndarray:
    """Return the solid angle of each panorama row's pixels [sr], shape (height, 1)."""
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    return ((edges[:-1] - edges[1:]) * 2 * np.pi / width)[:, None]
