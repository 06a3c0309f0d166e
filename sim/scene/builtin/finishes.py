"""Textures of the hard parts: glaze, turned wood, and the fibres of cord and cane."""

import numpy as np

from digs_warp.sim.scene.builtin.noise import mix, periodic_noise, smoothstep

SIZE = 1024

# sRGB 0..1.
GLAZE_DEEP = np.array((0.03, 0.25, 0.28), np.float32)
GLAZE_LIGHT = np.array((0.25, 0.55, 0.52), np.float32)
GLAZE_RIM = np.array((0.55, 0.36, 0.18), np.float32)
IRON = np.array((0.13, 0.10, 0.07), np.float32)
WALNUT_DARK = np.array((0.20, 0.11, 0.06), np.float32)
WALNUT_LIGHT = np.array((0.52, 0.33, 0.19), np.float32)
FLAX_DARK = np.array((0.42, 0.31, 0.19), np.float32)
FLAX_LIGHT = np.array((0.80, 0.69, 0.50), np.float32)


def glaze_texture(rng: np.random.Generator, rim_v: float) -> np.ndarray:
    """Return a running celadon glaze, sRGB, (SIZE, SIZE, 3), uint8, periodic from left to right.

    Args:
        rng: source of randomness.
        rim_v: height of the lip on the texture, 0 bottom to 1 top: there the glaze is thin and brown.
    """
    shape = (SIZE, SIZE)
    runs = periodic_noise(rng, shape, (10, 300), slope=1.4, stretch=(3.0, 1.0))
    cloud = periodic_noise(rng, shape, (5, 300), slope=1.3)
    v = 1 - (np.arange(SIZE, dtype=np.float32)[:, None] + 0.5) / SIZE
    thickness = smoothstep(-2.4, 2.4, runs + 0.6 * cloud)
    image = mix(GLAZE_LIGHT, GLAZE_DEEP, thickness)
    thin = smoothstep(0.075, 0.0, np.abs(v - rim_v) + 0.012 * runs)
    image = mix(image, GLAZE_RIM, thin * 0.9)
    specks = periodic_noise(rng, shape, (5, 14), slope=0.0)
    image = mix(image, IRON, smoothstep(2.6, 3.1, specks) * 0.8)
    return _bytes(image)


def walnut_texture(rng: np.random.Generator, profile: np.ndarray) -> np.ndarray:
    """Return wood turned from one block, sRGB, (256, SIZE, 3), uint8: the grain runs through the part.

    Args:
        rng: source of randomness.
        profile: (radius, z) of each row of the texture, bottom row first [m], shape (256, 2).
    """
    theta = (np.arange(SIZE, dtype=np.float32) + 0.5) / SIZE * 2 * np.pi
    radius, z = (profile[::-1, k : k + 1].astype(np.float32) for k in (0, 1))
    y, x = radius * np.sin(theta), radius * np.cos(theta)
    shape = (len(profile), SIZE)
    wobble = periodic_noise(rng, shape, (40, 500), slope=1.5)
    # Annual rings around a pith that lies outside the block and is slightly tilted.
    pith = np.hypot(y + 0.11 + 0.1 * x, z + 0.05 + 0.15 * x) + 0.0008 * wobble
    ring = (pith / 0.0042) % 1.0
    late_wood = smoothstep(0.1, 0.85, ring) * smoothstep(1.0, 0.93, ring)
    fibres = periodic_noise(rng, shape, (3, 60), slope=0.3, stretch=(1.0, 6.0))
    share = np.clip(0.38 + 0.34 * late_wood + 0.10 * fibres + 0.08 * wobble, 0, 1)
    return _bytes(mix(WALNUT_LIGHT, WALNUT_DARK, share))


def fibre_texture(rng: np.random.Generator, slant: int) -> np.ndarray:
    """Return twisted plant fibres, sRGB, (SIZE, SIZE, 3), uint8, periodic on all sides.

    Args:
        rng: source of randomness.
        slant: turns of the fibres over the height of the texture; 0: straight up.
    """
    shape = (SIZE, SIZE)
    straight = periodic_noise(rng, shape, (4, 400), slope=0.6, stretch=(8.0, 1.0))
    rows, columns = np.arange(SIZE)[:, None], np.arange(SIZE)[None, :]
    fibres = straight[rows, (columns + slant * rows) % SIZE]
    soil = periodic_noise(rng, shape, (30, 500), slope=1.0)
    share = np.clip(0.55 + 0.22 * fibres + 0.08 * soil, 0, 1)
    return _bytes(mix(FLAX_DARK, FLAX_LIGHT, share))


def _bytes(image: np.ndarray) -> np.ndarray:
    return np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)
