"""The textures of the built-in object, sRGB, uint8, periodic from left to right: wood, glaze, cloth, fibres.

The cloth is a kilim, woven thread by thread from a pattern of colored bands. The pattern is drawn on a grid
with one cell per crossing of threads; each cell is then filled with the image of a crossing: in a plain weave
the weft is on top in every other cell, the warp in the others.
"""

import numpy as np

from builtin_assets.vase import FOOT_OUTLINE, LIP_ROW, SEGMENTS, smooth_curve
from digs_warp.sim.scene.finishes import mix, periodic_noise, smoothstep
from digs_warp.sim.scene.shapes import Patch

SEED = 7
SIZE = 1024

# sRGB 0..1.
GLAZE_DEEP, GLAZE_LIGHT = np.array([(0.03, 0.25, 0.28), (0.25, 0.55, 0.52)], np.float32)
GLAZE_RIM, IRON = np.array([(0.55, 0.36, 0.18), (0.13, 0.10, 0.07)], np.float32)
WALNUT_DARK, WALNUT_LIGHT = np.array([(0.20, 0.11, 0.06), (0.52, 0.33, 0.19)], np.float32)
FLAX_DARK, FLAX_LIGHT = np.array([(0.42, 0.31, 0.19), (0.80, 0.69, 0.50)], np.float32)
WARP_WOOL = np.array((0.80, 0.72, 0.58), np.float32)
MADDER, INDIGO, CREAM, OCHRE, UMBER, SAGE = range(6)
# fmt: off
WOOL = np.array([(0.62, 0.17, 0.13), (0.14, 0.22, 0.40), (0.91, 0.85, 0.72),
                 (0.85, 0.60, 0.22), (0.23, 0.15, 0.11), (0.40, 0.52, 0.44)], np.float32)

# Bands of the cloth from the hem upward: (kind, wefts, ground color, figure colors).
BANDS: tuple[tuple[str, int, int, tuple[int, ...]], ...] = (
    ("plain", 3, UMBER, ()), ("plain", 2, CREAM, ()), ("zigzag", 8, MADDER, (CREAM, OCHRE)),
    ("plain", 2, UMBER, ()), ("diamonds", 24, INDIGO, (CREAM, OCHRE, MADDER, SAGE)),
    ("plain", 2, UMBER, ()), ("steps", 6, OCHRE, (MADDER,)), ("plain", 2, CREAM, ()),
    ("zigzag", 8, SAGE, (UMBER, CREAM)), ("plain", 3, MADDER, ()), ("steps", 6, CREAM, (INDIGO,)),
    ("plain", 3, INDIGO, ()), ("plain", 2, OCHRE, ()), ("plain", 9, MADDER, ()),
)
# fmt: on

# Threads around the cloth and up the cloth, and texels across one thread.
WARPS, WEFTS, TEXELS_PER_THREAD = 256, 80, 8


def textures(neck: Patch) -> dict[str, np.ndarray]:
    """Return the textures by the names of their materials, (height, width, 3)."""
    rng = np.random.default_rng(SEED)
    images = {
        "walnut": _walnut(rng),
        "glaze": _glaze(rng, rim_v=neck.uvs[LIP_ROW * (SEGMENTS + 1), 1]),
        "kilim": _kilim(rng),
        "cord": _fibres(rng, slant=2),
        "cane": _fibres(rng, slant=0),
    }
    return {n: np.rint(255 * np.clip(i, 0, 1)).astype(np.uint8) for n, i in images.items()}


def _walnut(rng: np.random.Generator) -> np.ndarray:
    """Wood turned from one block: the grain runs through the part."""
    profile = smooth_curve(FOOT_OUTLINE, 256)
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
    return mix(WALNUT_LIGHT, WALNUT_DARK, share)


def _glaze(rng: np.random.Generator, rim_v: float) -> np.ndarray:
    """A running celadon glaze, thin and brown at the lip, height ``rim_v`` on the texture (0 to 1)."""
    shape = (SIZE, SIZE)
    runs = periodic_noise(rng, shape, (10, 300), slope=1.4, stretch=(3.0, 1.0))
    cloud = periodic_noise(rng, shape, (5, 300), slope=1.3)
    v = 1 - (np.arange(SIZE, dtype=np.float32)[:, None] + 0.5) / SIZE
    image = mix(GLAZE_LIGHT, GLAZE_DEEP, smoothstep(-2.4, 2.4, runs + 0.6 * cloud))
    thin = smoothstep(0.075, 0.0, np.abs(v - rim_v) + 0.012 * runs)
    image = mix(image, GLAZE_RIM, thin * 0.9)
    specks = periodic_noise(rng, shape, (5, 14), slope=0.0)
    return mix(image, IRON, smoothstep(2.6, 3.1, specks) * 0.8)


def _fibres(rng: np.random.Generator, slant: int) -> np.ndarray:
    """Twisted plant fibres, periodic on all sides; ``slant``: turns over the height of the texture."""
    shape = (SIZE, SIZE)
    straight = periodic_noise(rng, shape, (4, 400), slope=0.6, stretch=(8.0, 1.0))
    rows, columns = np.arange(SIZE)[:, None], np.arange(SIZE)[None, :]
    fibres = straight[rows, (columns + slant * rows) % SIZE]
    soil = periodic_noise(rng, shape, (30, 500), slope=1.0)
    return mix(FLAX_DARK, FLAX_LIGHT, np.clip(0.55 + 0.22 * fibres + 0.08 * soil, 0, 1))


def _kilim(rng: np.random.Generator) -> np.ndarray:
    """The cloth, (640, 2048, 3); the hem is the bottom row."""
    rows = []
    for kind, height, ground, figures in BANDS:
        band = np.full((height, WARPS), ground)
        if kind == "zigzag":
            _draw_zigzag(band, figures)
        elif kind == "diamonds":
            _draw_diamonds(band, figures, rng)
        elif kind == "steps":
            _draw_steps(band, figures, rng)
        rows.append(band)
    return _weave(WOOL[np.concatenate(rows)[::-1]], rng)


def _draw_zigzag(band: np.ndarray, figures: tuple[int, ...]) -> None:
    height = len(band)
    x, y = np.arange(WARPS)[None, :], np.arange(height)[:, None]
    wave = np.abs((x % 16) - 8) * (height - 3) // 8
    band[np.abs(y - wave - 1) < 1] = figures[0]
    band[(y - wave - 1) >= 2] = figures[1]


def _draw_diamonds(band: np.ndarray, figures: tuple[int, ...], rng: np.random.Generator) -> None:
    """Stepped diamonds; no two neighbors have the same colors, so that every place looks different."""
    height, width = len(band), 32
    x = np.abs(np.arange(width) - (width - 1) / 2)[None, :]
    y = np.abs(np.arange(height) - (height - 1) / 2)[:, None]
    distance = np.floor(x / 2) * 2 * 0.75 + y
    for left in range(0, WARPS, width):
        colors = rng.permutation(figures)
        inner = INDIGO if colors[1] != INDIGO else CREAM
        cell = band[:, left : left + width]
        fills = (*colors[:2], inner, *colors[2:])
        for below, color in zip((11.5, 9.0, 6.0, 4.0, 1.5), fills, strict=True):
            cell[distance < below] = color
        for row in (3, height - 4):  # small crosses in the corners between the diamonds
            cell[row, :3] = cell[row, -2:] = colors[3]
            cell[row - 1 : row + 2, 0] = colors[3]


def _draw_steps(band: np.ndarray, figures: tuple[int, ...], rng: np.random.Generator) -> None:
    """Crenellations of slightly varying width, as a weaver makes them."""
    position, high = 0, True
    while position < WARPS:
        width = min(int(rng.integers(4, 9)), WARPS - position)
        if high:
            band[: len(band) - 2, position : position + width] = figures[0]
            band[-2, position + width // 2] = figures[0]
        position, high = position + width, not high


def _weave(colors: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the image of the threads, 0..1, float32, from the colors of the crossings."""
    size = TEXELS_PER_THREAD
    # Every weft, every warp and every crossing has a slightly different shade.
    shade = 1 + 0.06 * rng.standard_normal((WEFTS, 1)) + 0.03 * rng.standard_normal((1, WARPS))
    shade = shade + 0.05 * rng.standard_normal((WEFTS, WARPS))
    weft_on_top = np.add.outer(np.arange(WEFTS), np.arange(WARPS)) % 2 == 0
    # The weft is packed tightly: a little of it shows even where the warp is on top.
    wool = np.where(weft_on_top[..., None], colors, mix(colors, WARP_WOOL, 0.22))
    cells = (wool * shade[..., None]).astype(np.float32)
    image = cells.repeat(size, axis=0).repeat(size, axis=1)

    # Brightness of a horizontal thread that dips down at both ends.
    t = (np.arange(size, dtype=np.float32) + 0.5) / size * 2 - 1
    crossing = 1.1 * np.sqrt(1 - 0.6 * t * t)[:, None] * (1 - 0.18 * np.abs(t) ** 3)[None, :]
    on_top = weft_on_top.repeat(size, axis=0).repeat(size, axis=1)
    relief = np.where(on_top, *(np.tile(c, (WEFTS, WARPS)) for c in (crossing, crossing.T)))
    fibres = periodic_noise(rng, image.shape[:2], (2.5, 24), slope=0.5, stretch=(1.0, 2.5))
    fading = periodic_noise(rng, image.shape[:2], (60, 640), slope=1.0)
    return image * (relief * (1 + 0.05 * fibres) * (1 + 0.05 * fading))[..., None]
