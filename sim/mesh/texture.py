"""The colour texture of a material, where the mesh has coordinates for it."""

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np

from digs_warp.sim.mesh.parts import MeshPart
from digs_warp.sim.mesh.pixels import rgb_pixels

logger = logging.getLogger(__name__)


def color_texture(image: Any, name: str, parts: Sequence[MeshPart]) -> np.ndarray | None:
    """Return the sRGB pixels, (height, width, 3), uint8; None without image or texture coordinates."""
    if image is None:
        return None
    if parts[0].uvs is None:
        logger.warning("material '%s': no texture coordinates, drawn without its texture", name)
        return None
    return rgb_pixels(image, name)
