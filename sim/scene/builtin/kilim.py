"""The texture of the cloth: a kilim, woven thread by thread from a pattern of colored bands.

The pattern is drawn on a grid with one cell per crossing of threads. Each cell is then filled with the
image of a crossing: in a plain weave the weft is on top in every other cell, the warp in the others.
"""

import numpy as np

from digs_warp.sim.scene.builtin.noise import mix, periodic_noise

# Threads around the cloth and up the cloth, and texels across one thread.
WARPS = 256
WEFTS = 80
TEXELS_PER_THREAD = 8

# Dyed wool, sRGB 0..1.
MADDER = 0
INDIGO = 1
CREAM = 2
OCHRE = 3
UMBER = 4
SAGE = 5
PALETTE = np.array(
    [
        (0.62, 0.17, 0.13),
        (0.14, 0.22, 0.40),
        (0.91, 0.85, 0.72),
        (0.85, 0.60, 0.22),
        (0.23, 0.15, 0.11),
        (0.40, 0.52, 0.44),
    ],
    np.float32,
)
WARP_WOOL = np.array((0.80, 0.72, 0.58), np.float32)

# Bands from the hem upward: (kind, wefts, ground color, figure colors).
BANDS: tuple[tuple[str, int, int, tuple[int, ...]], ...] = (
    ("plain", 3, UMBER, ()),
    ("plain", 2, CREAM, ()),
    ("zigzag", 8, MADDER, (CREAM, OCHRE)),
    ("plain", 2, UMBER, ()),
    ("diamonds", 24, INDIGO, (CREAM, OCHRE, MADDER, SAGE)),
    ("plain", 2, UMBER, ()),
    ("steps", 6, OCHRE, (MADDER,)),
    ("plain", 2, CREAM, ()),
    ("zigzag", 8, SAGE, (UMBER, CREAM)),
    ("plain", 3, MADDER, ()),
    ("steps", 6, CREAM, (INDIGO,)),
    ("plain", 3, INDIGO, ()),
    ("plain", 2, OCHRE, ()),
    ("plain", 9, MADDER, ()),
)


def kilim_texture(rng: np.random.Generator) -> np.ndarray:
    """Return the cloth, sRGB, (640, 2048, 3), uint8, periodic left to right; the hem is the bottom row."""
    pattern = _pattern(rng)
    image = _weave(PALETTE[pattern], rng)
    return np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)


def _pattern(rng: np.random.Generator) -> np.ndarray:
    """Return the color index of every crossing, row 0 on top, shape (WEFTS, WARPS)."""
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
    return np.concatenate(rows)[::-1]


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
        cell = band[:, left : left + width]
        cell[distance < 11.5] = colors[0]
        cell[distance < 9.0] = colors[1]
        cell[distance < 6.0] = INDIGO if colors[1] != INDIGO else CREAM
        cell[distance < 4.0] = colors[2]
        cell[distance < 1.5] = colors[3]
        # Small crosses in the corners between the diamonds.
        for row in (3, height - 4):
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
    """Return the image of the threads, sRGB 0..1, float32, from the colors of the crossings."""
    size = TEXELS_PER_THREAD
    shape = (WEFTS * size, WARPS * size)
    # Every weft, every warp and every crossing has a slightly different shade.
    shade = 1 + 0.06 * rng.standard_normal((WEFTS, 1)) + 0.03 * rng.standard_normal((1, WARPS))
    shade = shade + 0.05 * rng.standard_normal((WEFTS, WARPS))
    weft_on_top = np.add.outer(np.arange(WEFTS), np.arange(WARPS)) % 2 == 0
    # The weft is packed tightly: a little of it shows even where the warp is on top.
    wool = np.where(weft_on_top[..., None], colors, mix(colors, WARP_WOOL, 0.22))
    cells = (wool * shade[..., None]).astype(np.float32)

    image = np.repeat(np.repeat(cells, size, axis=0), size, axis=1)
    relief = np.where(
        np.repeat(np.repeat(weft_on_top, size, axis=0), size, axis=1),
        np.tile(_crossing(), (WEFTS, WARPS)),
        np.tile(_crossing().T, (WEFTS, WARPS)),
    )
    fibres = periodic_noise(rng, shape, (2.5, 24), slope=0.5, stretch=(1.0, 2.5))
    fading = periodic_noise(rng, shape, (60, 640), slope=1.0)
    light = relief * (1 + 0.05 * fibres) * (1 + 0.05 * fading)
    return image * light[..., None]


def _crossing() -> np.ndarray:
    """Return the brightness of a horizontal thread that dips down at both ends, square, about 0.6..1.1."""
    t = (np.arange(TEXELS_PER_THREAD, dtype=np.float32) + 0.5) / TEXELS_PER_THREAD * 2 - 1
    round_across = np.sqrt(1 - 0.6 * t * t)[:, None]
    dip_along = (1 - 0.18 * np.abs(t) ** 3)[None, :]
    return 1.1 * round_across * dip_along
