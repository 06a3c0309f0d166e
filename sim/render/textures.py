"""Textures as mip pyramids in one flat array, and their filtered look-up in kernels.

The level of a look-up follows from the ray cone: the width of a pixel's cone at the surface, stretched by the
angle of incidence, compared with the size of a texel (Akenine-Moller et al., "Texture
Level of Detail Strategies for Real-Time Ray Tracing", Ray Tracing Gems, 2019, eq. 20-6).

Texels are bytes packed into one 32-bit word: a quarter of the memory traffic of linear floats. Colors are
sRGB bytes, averaged in linear light: a table of 256 values decodes them. A second table is for linear
quantities (roughness, normals).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.data.images import linear_from_srgb, srgb_from_linear, to_uint8

# Byte -> value: the table of colors, followed by that of linear quantities. SRGB and LINEAR are their first
# indices.
BYTES = np.arange(256) / 255.0
DECODE = np.concatenate([linear_from_srgb(BYTES), BYTES]).astype(np.float32)
SRGB = wp.constant(0)
LINEAR = wp.constant(256)


@dataclass(frozen=True, eq=False)
class TextureImage:
    """Pixels, (height, width) or (height, width, 1 to 3), uint8, and `SRGB` or `LINEAR`."""

    pixels: np.ndarray
    table: int


@wp.struct
class TextureSet:
    """All textures of a scene; texture t owns levels first_level[t] .. first_level[t + 1] - 1."""

    texels: wp.array[wp.uint32]  # 0x00BBGGRR
    decode: wp.array[float]  # [512]
    log2_widths: wp.array[float]  # [textures] log2 of the geometric mean of width and height
    offsets: wp.array[int]  # [levels] first texel of a level
    sizes: wp.array[wp.vec2i]  # [levels] width, height
    first_level: wp.array[int]  # [textures + 1]


@wp.func
def fetch_texel(textures: TextureSet, index: int, table: int) -> wp.vec3:
    """One texel, decoded."""
    word = int(textures.texels[index])
    return wp.vec3(
        textures.decode[table + (word & 255)],
        textures.decode[table + ((word >> 8) & 255)],
        textures.decode[table + ((word >> 16) & 255)],
    )


@wp.func
def sample_texture_level(textures: TextureSet, level: int, uv: wp.vec2, table: int) -> wp.vec3:
    """Bilinear value of one level; coordinates repeat, v = 0 is the bottom row."""
    width = textures.sizes[level][0]
    height = textures.sizes[level][1]
    # Whole numbers are removed first: large coordinates would lose their fraction.
    x = (uv[0] - wp.floor(uv[0])) * float(width) - 0.5
    y = (1.0 - (uv[1] - wp.floor(uv[1]))) * float(height) - 0.5
    left = int(wp.floor(x))
    top = int(wp.floor(y))
    fx = x - float(left)
    fy = y - float(top)
    x0 = wp.where(left < 0, left + width, left)
    x1 = wp.where(left + 1 < width, left + 1, 0)
    first = textures.offsets[level]
    row0 = first + wp.where(top < 0, top + height, top) * width
    row1 = first + wp.where(top + 1 < height, top + 1, 0) * width
    above = wp.lerp(
        fetch_texel(textures, row0 + x0, table), fetch_texel(textures, row0 + x1, table), fx
    )
    below = wp.lerp(
        fetch_texel(textures, row1 + x0, table), fetch_texel(textures, row1 + x1, table), fx
    )
    return wp.lerp(above, below, fy)


@wp.func
def sample_texture(
    textures: TextureSet, texture: int, uv: wp.vec2, spread: float, table: int
) -> wp.vec3:
    """Trilinear value, decoded by ``table`` (SRGB or LINEAR).

    ``spread`` is log2 of the share of the texture's width to average over.
    """
    first = textures.first_level[texture]
    last = textures.first_level[texture + 1] - 1
    level = wp.clamp(spread + textures.log2_widths[texture], 0.0, float(last - first))
    fine = int(wp.floor(level))
    blend = level - float(fine)
    color = sample_texture_level(textures, first + fine, uv, table)
    if blend > 0.0:
        color = wp.lerp(color, sample_texture_level(textures, first + fine + 1, uv, table), blend)
    return color


def mip_chain(image: np.ndarray) -> list[np.ndarray]:
    """Return the image and its halvings down to one pixel, float32; all have the same mean.

    Args:
        image: linear values, shape (height, width, channels).
    """
    levels = [image.astype(np.float32, copy=False)]
    while levels[-1].shape[0] > 1 or levels[-1].shape[1] > 1:
        levels.append(_halve(_halve(levels[-1], 0), 1))
    return levels


def _halve(image: np.ndarray, axis: int) -> np.ndarray:
    """Halve one axis with a box filter; odd lengths use the exact three-tap box, which keeps the mean."""
    length = image.shape[axis]
    if length == 1:
        return image
    image = np.moveaxis(image, axis, 0)
    half = length // 2
    if length % 2 == 0:
        halved = 0.5 * (image[0::2] + image[1::2])
    else:
        i = np.arange(half, dtype=np.float32).reshape(-1, *[1] * (image.ndim - 1))
        left, middle, right = image[0:-1:2], image[1::2], image[2::2]
        halved = ((half - i) * left + half * middle + (i + 1) * right) / np.float32(length)
    return np.moveaxis(halved, 0, axis)


def pack_textures(images: Sequence[TextureImage]) -> TextureSet:
    """Build the pyramids of the images."""
    words: list[np.ndarray] = []
    sizes: list[tuple[int, int]] = []
    first_level = [0]
    for image in images:
        levels = _encoded_levels(image)
        words += [_pack_words(level) for level in levels]
        sizes += [(level.shape[1], level.shape[0]) for level in levels]
        first_level.append(len(sizes))
    counts = [len(word) for word in words]
    log2_widths = [0.5 * np.log2(image.pixels.shape[0] * image.pixels.shape[1]) for image in images]
    textures = TextureSet()
    # An empty set keeps one word: Warp arrays of length zero have no address.
    flat = np.concatenate([*words, np.zeros(1, np.uint32)])
    textures.texels = wp.array(flat, dtype=wp.uint32, device="cpu")
    textures.decode = wp.array(DECODE, dtype=float, device="cpu")
    textures.log2_widths = wp.array([*log2_widths, 0.0], dtype=float, device="cpu")
    starts = np.cumsum([0, *counts])
    textures.offsets = wp.array(starts.astype(np.int32), dtype=int, device="cpu")
    textures.sizes = wp.array(np.array([*sizes, (1, 1)], np.int32), dtype=wp.vec2i, device="cpu")
    textures.first_level = wp.array(np.array(first_level, np.int32), dtype=int, device="cpu")
    return textures


def _encoded_levels(image: TextureImage) -> list[np.ndarray]:
    """Return the pyramid in bytes; level 0 is the image itself, not a decoded and encoded copy."""
    pixels = image.pixels[..., None] if image.pixels.ndim == 2 else image.pixels
    chain = mip_chain(DECODE[pixels.astype(np.int32) + image.table])[1:]
    if image.table == SRGB:
        chain = [srgb_from_linear(level) for level in chain]
    return [pixels, *(to_uint8(level) for level in chain)]


def _pack_words(image: np.ndarray) -> np.ndarray:
    channels = np.moveaxis(image.astype(np.uint32), -1, 0)
    word = np.zeros(image.shape[:2], np.uint32)
    for number, channel in enumerate(channels):
        word |= channel << np.uint32(8 * number)
    return word.reshape(-1)
