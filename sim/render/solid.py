"""Which faces can stop a ray on its way to opaque surfaces, so that other rays need not meet the rest.

A ray through a bottle meets eight walls of glass. Whatever `digs_warp.sim.render.surface.trace` passes in any
case can be left out of the BVH: then it meets what stands behind the bottle at once.
"""

import numpy as np

from digs_warp.sim.scene.scene import OPAQUE_SHARE, Material, Scene

# Textures are compared in this many cells along each side. A face is judged by the cells that it touches and
# those around them: filtered texels reach that far unless a pixel is wider than a cell.
CELLS = 64


def stopping_faces(scene: Scene) -> np.ndarray:
    """Return which faces may hide more than a transparent surface does, (m,), bool."""
    stops = np.zeros(len(scene.faces), bool)
    for number, material in enumerate(scene.materials):
        own = np.flatnonzero(scene.face_materials == number)
        hiding = _hiding_cells(material)
        if hiding.all() or not hiding.any():
            stops[own] = hiding.all()
        else:
            stops[own] = _touches(scene.uvs[scene.faces[own]], hiding)
    return stops


def _hiding_cells(material: Material) -> np.ndarray:
    """Return in which cells the material may hide more than a transparent one, (CELLS, CELLS), bool."""
    shape = (CELLS, CELLS)
    opacity = np.full(shape, material.opacity, np.float32)
    transmission = np.full(shape, material.transmission, np.float32)
    if material.opacity_texture is not None:
        opacity = _largest_around(material.opacity_texture / np.float32(255))
    if material.transmission_texture is not None:
        transmission = -_largest_around(material.transmission_texture / np.float32(-255))
    is_hole = (opacity == 0) | (opacity < np.float32(material.alpha_cutoff))
    return ~is_hole & (opacity * (1 - transmission) >= np.float32(OPAQUE_SHARE))


def _largest_around(texture: np.ndarray) -> np.ndarray:
    """Return the largest texel of each cell and those around it, (CELLS, CELLS), float32; row 0 on top."""
    import cv2

    rows, columns = (np.arange(CELLS) * size // CELLS for size in texture.shape)
    cells = np.maximum.reduceat(np.maximum.reduceat(texture, rows, axis=0), columns, axis=1)
    grown = cv2.dilate(np.pad(cells, 1, mode="wrap"), np.ones((3, 3), np.uint8))
    return grown[1:-1, 1:-1]


def _touches(uvs: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return which triangles, (n, 3, 2), touch a marked cell with the box around them; textures repeat."""
    # Twice the texture along each side: boxes of less than its size need not be cut at its border.
    counts = np.zeros((2 * CELLS + 1, 2 * CELLS + 1), np.int64)
    counts[1:, 1:] = np.tile(cells[::-1], (2, 2)).cumsum(axis=0).cumsum(axis=1)  # v points up
    first = np.floor(uvs.min(axis=1) * CELLS).astype(np.int64)
    size = np.floor(uvs.max(axis=1) * CELLS).astype(np.int64) - first + 1
    (left, low), (width, height) = (first % CELLS).T, np.minimum(size, CELLS).T
    right, high = left + width, low + height
    inside = counts[high, right] - counts[low, right] - counts[high, left] + counts[low, left]
    return inside > 0
