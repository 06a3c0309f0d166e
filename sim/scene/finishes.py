"""Random finishes: band-limited textures that tile without a seam, plain and patterned materials."""

import colorsys

import numpy as np

from digs_warp.sim.scene.scene import Material

TEXELS = 256
PATTERNS = ("plain", "stripes", "checks", "speckles")


def periodic_noise(
    rng: np.random.Generator,
    shape: tuple[int, int],
    wavelengths: tuple[float, float],
    slope: float = 1.0,
    stretch: tuple[float, float] = (1.0, 1.0),
) -> np.ndarray:
    """Return Gaussian noise with standard deviation 1, periodic in both directions, float32.

    Args:
        rng: source of randomness.
        shape: (height, width) of the result.
        wavelengths: shortest and longest period in it [pixels].
        slope: amplitudes fall as frequency to this power: 0 is white, 1 looks natural.
        stretch: factors on the length of features (down, across); (1, 8) makes horizontal fibres.
    """
    height, width = shape
    fy = np.fft.fftfreq(height).astype(np.float32)[:, None] * stretch[0]
    fx = np.fft.rfftfreq(width).astype(np.float32)[None, :] * stretch[1]
    frequency = np.sqrt(fx * fx + fy * fy)
    shortest, longest = wavelengths
    inside = (frequency <= 1 / shortest) & (frequency >= 1 / longest)
    gain = np.where(inside, np.maximum(frequency, 1e-6) ** -slope, 0)
    spectrum = np.fft.rfft2(rng.standard_normal(shape, dtype=np.float32)) * gain
    noise = np.fft.irfft2(spectrum, s=shape)
    return (noise / noise.std()).astype(np.float32)


def mix(a: np.ndarray, b: np.ndarray, share: np.ndarray | float) -> np.ndarray:
    """Blend two colors or color images; ``share`` is that of b, 0..1, shape (height, width) or a number."""
    share = np.asarray(share, np.float32)
    if share.ndim:
        share = share[..., None]
    return a + (np.asarray(b, np.float32) - a) * share


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """Return 0 below ``low``, 1 above ``high``, and a smooth step between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def random_finish(rng: np.random.Generator, texels: int = TEXELS) -> Material:
    """Return a plain or patterned material of two colors, from glossy to matte.

    Args:
        rng: source of colors, pattern and gloss.
        texels: sides of the texture.
    """
    pattern = PATTERNS[rng.integers(len(PATTERNS))]
    first, second = _color(rng), _color(rng)
    share = _pattern(pattern, rng, texels)
    pixels = np.rint(255 * mix(first, second, share)).astype(np.uint8)
    return Material(pattern, np.ones(3, np.float32), pixels, roughness=rng.uniform(0.15, 1.0))


def _pattern(pattern: str, rng: np.random.Generator, texels: int) -> np.ndarray:
    """Return the share of the second color, (texels, texels), 0..1."""
    repeats = int(rng.integers(2, 9))
    across = np.arange(texels) * repeats // texels % 2
    if pattern == "plain":
        return np.zeros((texels, texels), np.float32)
    if pattern == "stripes":
        stripes = np.tile(across, (texels, 1))
        return (stripes if rng.random() < 0.5 else stripes.T).astype(np.float32)
    if pattern == "checks":
        return (across[:, None] ^ across[None]).astype(np.float32)
    return (periodic_noise(rng, (texels, texels), (4, 32)) > 0.8).astype(np.float32)


def _color(rng: np.random.Generator) -> np.ndarray:
    """Return a color, sRGB, (3,), float32."""
    hue, saturation, value = rng.random(), rng.random() ** 0.7, rng.uniform(0.15, 0.95)
    return np.array(colorsys.hsv_to_rgb(hue, saturation, value), np.float32)
