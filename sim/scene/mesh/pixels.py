"""Pixels of the textures that trimesh hands over as PIL images."""

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np

from digs_warp.bounds import TEXTURE
from digs_warp.sim.scene.mesh.parts import MeshPart

logger = logging.getLogger(__name__)

# Barycentric sample points for the mean of a texture over a triangle: a rule that is exact for quadratic
# functions.
SAMPLE_POINTS = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0


def rgb_pixels(image: Any, name: str) -> np.ndarray:
    """Decode to (height, width, 3), uint8; alpha is dropped, not blended.

    Args:
        image: of PIL.
        name: of the material, for the message.

    Raises:
        DigsError: larger than `digs_warp.bounds.TEXTURE`.
        ValueError: truncated or in an unknown encoding.
    """
    TEXTURE.check(f"texture of material '{name}'", image.width * image.height)
    try:
        if image.mode.startswith("I"):  # 16-bit gray: PIL's own conversion clips at 255
            gray = (np.asarray(image).astype(np.float64) / 257.0).clip(0, 255)
            return np.repeat(np.rint(gray).astype(np.uint8)[..., None], 3, axis=2)
        return np.ascontiguousarray(np.asarray(image.convert("RGB"), np.uint8))
    except (OSError, ValueError, SyntaxError) as error:
        raise ValueError(f"the texture of material '{name}' cannot be decoded ({error})") from error


def alpha_pixels(image: Any, name: str) -> np.ndarray | None:
    """Decode the alpha channel to (height, width), uint8; None where every pixel is opaque."""
    TEXTURE.check(f"texture of material '{name}'", image.width * image.height)
    try:
        if "A" not in image.getbands() and "transparency" not in image.info:
            return None
        alpha = np.ascontiguousarray(np.asarray(image.convert("RGBA"), np.uint8)[..., 3])
    except (OSError, ValueError, SyntaxError) as error:
        raise ValueError(f"the texture of material '{name}' cannot be decoded ({error})") from error
    return alpha if alpha.min() < 255 else None


def mean_over_surface(image: np.ndarray, parts: Sequence[MeshPart]) -> np.ndarray:
    """Return the mean texel, shape (c,), over the surface of the parts, without unused parts of the texture.

    Args:
        image: shape (height, width, c).
        parts: with texture coordinates.
    """
    height, width, channels = image.shape
    total, weight = np.zeros(channels), 0.0
    for part in parts:
        assert part.uvs is not None  # parts are grouped by it
        uvs = np.einsum("sk,mkc->msc", SAMPLE_POINTS, part.uvs[part.faces])
        columns = np.floor(uvs[..., 0] * width).astype(np.int64) % width
        rows = np.floor((1.0 - uvs[..., 1]) * height).astype(np.int64) % height
        a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
        areas = np.nan_to_num(np.linalg.norm(np.cross(b - a, c - a), axis=1))
        total += areas @ image[rows, columns].mean(axis=1)
        weight += areas.sum()
    return total / weight if weight > 0 else image.mean(axis=(0, 1))


def color_texture(image: Any, name: str, parts: Sequence[MeshPart]) -> np.ndarray | None:
    """Return the sRGB pixels, (height, width, 3), uint8; None without image or texture coordinates."""
    if image is None:
        return None
    if parts[0].uvs is None:
        logger.warning("material '%s': no texture coordinates, drawn without its texture", name)
        return None
    return rgb_pixels(image, name)
