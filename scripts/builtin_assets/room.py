"""The built-in surround: a photographer's room, painted by code.

Six square walls are painted as flat images (a cube map) and then looked up along every direction of the
panorama. Everything has fine detail: structure from motion finds its features in the surround.
Radiance is linear; 1 is about a white wall in the room's own light, lamps and windows are far brighter.
"""

import numpy as np

from digs_warp.sim.scene.environment import panorama_directions

WIDTH, HEIGHT = 2048, 1024  # of the panorama

SEED = 20

# A wall is an array of linear RGB, shape (WALL_SIZE, WALL_SIZE, 3), row 0 on top. A texel in its middle is
# 0.85 times as wide as a pixel of the panorama.
WALL_SIZE = 768

# Radiance of the light sources.
SOFT_BOX, SKY, LAMP = 16.0, 1.2, 6.0


def room_radiance() -> np.ndarray:
    """Return the panorama, linear radiance, (HEIGHT, WIDTH, 3), float32."""
    painters = (_book_wall, _brick_wall, _window_wall, _picture_wall, _ceiling, _floor)
    seeds = np.random.SeedSequence(SEED).spawn(len(painters))
    directions = panorama_directions(WIDTH, HEIGHT).astype(np.float32).reshape(-1, 3)
    x, y, z = directions.T
    ax, ay, az = np.abs(directions.T)
    # Per wall: the pixels that face it, and (right, down) on it as seen from inside.
    faces = (
        (x > 0, ax, -y, -z),
        (x < 0, ax, y, -z),
        (y > 0, ay, x, -z),
        (y < 0, ay, -x, -z),
        (z > 0, az, -y, x),
        (z < 0, az, -y, -x),
    )
    longest = np.maximum(np.maximum(ax, ay), az)
    panorama = np.empty((WIDTH * HEIGHT, 3), np.float32)
    for paint, seed, (sign, depth, right, down) in zip(painters, seeds, faces, strict=True):
        here = np.flatnonzero(sign & (depth == longest))
        u, v = ((0.5 + 0.5 * each[here] / depth[here]) * WALL_SIZE - 0.5 for each in (right, down))
        panorama[here] = _bilinear(paint(np.random.default_rng(seed)), u, v)
    return panorama.reshape(HEIGHT, WIDTH, 3)


def _bilinear(image: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the values of an image, (n, n, 3), at positions [px], clamped at the border."""
    left, top = (np.clip(np.floor(c).astype(np.int32), 0, len(image) - 2) for c in (u, v))
    fu, fv = (np.clip(c, 0, 1)[:, None].astype(np.float32) for c in (u - left, v - top))
    above, below = (
        image[row, left] * (1 - fu) + image[row, left + 1] * fu for row in (top, top + 1)
    )
    return above * (1 - fv) + below * fv


def _book_wall(rng: np.random.Generator) -> np.ndarray:
    """Shelves full of books."""
    wall = _plain((0.30, 0.20, 0.12), _fall_off(1.0, 0.7) * (1 + 0.2 * _noise(rng, (12, 192))))
    shelf = 84
    for top in range(24, WALL_SIZE - shelf, shelf):
        wall[top : top + shelf - 12] *= 0.25
        left = 16
        while left < WALL_SIZE - 40:
            if rng.random() < 0.06:  # a gap, where the eye rests
                left += int(rng.integers(15, 50))
            width, height = int(rng.integers(7, 24)), int(rng.integers(46, 70))
            color = _muted(rng.uniform(0.03, 0.8, 3)) * rng.uniform(0.3, 1.0)
            book = wall[top + shelf - 12 - height : top + shelf - 12, left : left + width]
            across = np.linspace(-1, 1, width)
            book[:] = color * (1.0 - 0.5 * across**2)[:, None]
            for _ in range(int(rng.integers(1, 4))):  # lines of print and ribs
                line = int(rng.integers(4, height - 8))
                book[line : line + int(rng.integers(2, 8)), 1:-1] = rng.uniform(0.1, 1.0, 3)
            left += width + 1
        wall[top + shelf - 12 : top + shelf - 9] *= 1.8  # lit front edge of the board
    return wall * (1 + 0.08 * _noise(rng, (96, 384)))[..., None]


def _brick_wall(rng: np.random.Generator) -> np.ndarray:
    """Painted brick with two strip lamps and posters."""
    rows, columns = 32, 12
    v, u = np.mgrid[0:WALL_SIZE, 0:WALL_SIZE].astype(np.float32) / WALL_SIZE
    row = (v * rows).astype(np.int32)
    along = u * columns + 0.5 * (row % 2)
    column = along.astype(np.int32)
    tint = rng.uniform(0.65, 1.25, (rows, columns + 1)).astype(np.float32)[row, column]
    joint = ((v * rows) % 1 < 0.10) | (along % 1 < 0.04)
    shade = _fall_off(0.95, 0.65) * np.where(joint, 1.25, tint) * (1 + 0.15 * _noise(rng))
    wall = _plain((0.55, 0.30, 0.22), shade)
    wall[joint] = wall[joint].mean(axis=1, keepdims=True)
    for left, top in ((120, 250), (430, 300)):
        _paint_picture(rng, _frame(wall, (top, left, 190, 150), 0.85, 5))
    for left in (70, 640):
        _light_up(_frame(wall, (150, left, 430, 34), 0.02, 4), LAMP * np.ones(3))
    return wall


def _window_wall(rng: np.random.Generator) -> np.ndarray:
    """Three windows with sky, hills and foliage behind bars; panelling below."""
    wall = _plain((0.62, 0.64, 0.60), _fall_off(0.75, 0.6) * (1 + 0.08 * _noise(rng)))
    foliage = _noise(rng, (20, 60, 180, 384))
    ridge = np.cumsum(rng.standard_normal(WALL_SIZE)) * 1.5
    view = np.linspace(1.0, 0.55, WALL_SIZE)[:, None, None] * np.array([0.75, 0.9, 1.1]) * SKY
    view = view * (1 + 0.12 * _noise(rng, (8, 24, 60)))[..., None]  # clouds
    below = np.arange(WALL_SIZE)[:, None] > 330 + ridge
    leaves = np.array([0.35, 0.55, 0.16]) * np.exp(0.5 * foliage)[..., None]
    view = np.where(below[..., None], 0.9 * leaves, view)
    for left in (70, 300, 530):
        pane = _frame(wall, (120, left, 360, 170), 0.9, 9)
        pane[:] = view[120:480, left : left + 170]
        pane[:, 82:88] = 0.5
        pane[117:123] = pane[237:243] = 0.5
    for left in range(20, WALL_SIZE - 100, 124):
        panel = wall[560:730, left : left + 104]
        panel[:4] *= 0.5
        panel[-4:] *= 1.4
        panel[:, :4] *= 0.6
        panel[:, -4:] *= 1.3
        panel *= (1 + 0.3 * _stretch(rng.standard_normal((12, 40)), 170, 104))[..., None]
    return wall.astype(np.float32)


def _picture_wall(rng: np.random.Generator) -> np.ndarray:
    """Patterned wallpaper with a gallery of pictures."""
    v, u = np.mgrid[0:WALL_SIZE, 0:WALL_SIZE].astype(np.float32)
    motif = np.sin(u * 0.26) * np.sin(v * 0.26)
    motif = motif + 0.5 * np.sin((u + v) * 0.13) * np.cos((u - v) * 0.39)
    paper = _fall_off(0.9, 0.6) * (1 + 0.16 * motif + 0.12 * _noise(rng))
    wall = _plain((0.34, 0.46, 0.48), paper)
    left = 40
    while left < WALL_SIZE - 130:
        width = int(rng.integers(90, 170))
        width = min(width, WALL_SIZE - 40 - left)
        top = int(rng.integers(90, 140))
        for height in rng.integers(100, 180, 3):
            if top + height > WALL_SIZE - 110:
                break
            border = int(rng.integers(4, 10))
            inside = _frame(
                wall, (top, left, int(height), width), rng.uniform(0.02, 0.7, 3), border
            )
            _paint_picture(rng, inside)
            top += int(height) + 46
        left += width + 40
    return wall


def _paint_picture(rng: np.random.Generator, canvas: np.ndarray) -> None:
    """Fill a canvas, (h, w, 3), with an abstract picture in two to three colors."""
    height, width = canvas.shape[:2]
    fields = [_stretch(rng.standard_normal((n, n)), height, width) for n in (4, 9, 24, 60)]
    mix = sum(field / (1 + i) for i, field in enumerate(fields))
    low, high, line = (_muted(color) for color in rng.uniform(0.03, 0.95, (3, 3)))
    share = 1 / (1 + np.exp(-3 * mix))[..., None]
    canvas[:] = low * (1 - share) + high * share
    canvas[np.abs(mix % 0.8 - 0.4) < 0.05] = line


def _ceiling(rng: np.random.Generator) -> np.ndarray:
    """Ceiling tiles with pinholes, soft boxes and spot lamps."""
    wall = _plain((0.72, 0.71, 0.69), _fall_off(0.8, 0.8) * (1 + 0.1 * _noise(rng)))
    holes = rng.random((WALL_SIZE // 2, WALL_SIZE // 2)) < 0.05
    wall[np.repeat(np.repeat(holes, 2, 0), 2, 1)] *= 0.55
    for line in range(0, WALL_SIZE, 96):
        wall[line : line + 4] *= 0.5
        wall[:, line : line + 4] *= 0.5
    for box in ((130, 120, 190, 260), (420, 470, 220, 160), (110, 560, 120, 120)):
        _light_up(_frame(wall, box, 0.03, 7), SOFT_BOX * np.ones(3))
    for top, left in ((520, 130), (520, 260), (640, 200)):
        _light_up(_frame(wall, (top, left, 26, 26), 0.05, 4), LAMP * np.array([1.0, 0.8, 0.55]))
    return wall


def _floor(rng: np.random.Generator) -> np.ndarray:
    """Oak boards under a woven rug."""
    boards = 16
    v, u = np.mgrid[0:WALL_SIZE, 0:WALL_SIZE].astype(np.float32) / WALL_SIZE
    board = (u * boards).astype(np.int32)
    start = rng.random(boards).astype(np.float32)
    plank = ((v * 3 + start[board]) % 3.0).astype(np.int32)
    tint = rng.uniform(0.7, 1.25, (boards, 3)).astype(np.float32)[board, plank]
    grain = _stretch(rng.standard_normal((24, 385), dtype=np.float32))
    joint = ((u * boards) % 1 < 0.035) | ((v * 3 + start[board]) % 1 < 0.006)
    shade = _fall_off(0.75, 0.75) * tint * (1 + 0.25 * grain + 0.1 * _noise(rng, (6, 48)))
    wall = _plain((0.48, 0.33, 0.20), shade * np.where(joint, 0.35, 1.0))
    _lay_rug(rng, wall[130:640, 110:660])
    return wall


def _lay_rug(rng: np.random.Generator, rug: np.ndarray) -> None:
    """Weave a rug of nested borders and lozenges into a part of the floor, (h, w, 3)."""
    height, width = rug.shape[:2]
    v, u = np.mgrid[0:height, 0:width].astype(np.float32)
    edge = np.minimum(np.minimum(v, height - 1 - v), np.minimum(u, width - 1 - u))
    red, sand, navy, rust, green = (42, 7, 6), (75, 62, 40), (6, 10, 24), (55, 20, 8), (10, 28, 22)
    colors = np.array([red, sand, navy, rust, green]) / 100
    lozenge = np.abs((u % 64) - 32) + np.abs((v % 88) - 44) * 0.75
    # Every lozenge has different rings: a repeated motif would look the same from many places.
    cell = (v // 88).astype(np.int32) * 16 + (u // 64).astype(np.int32)
    rings = rng.integers(0, 5, (cell.max() + 1, 8))
    motif = rings[cell, (lozenge / 11).astype(np.int32)]
    border = (edge / 9).astype(np.int32)
    dashes = ((u + v) / 13).astype(np.int32) % 2
    pick = np.where(edge < 54, (border + dashes * (border % 2)) % 5, motif)
    weave = 1 + 0.15 * np.sin(u * 2.1) * np.sin(v * 2.1)
    wear = 1 + 0.18 * _stretch(rng.standard_normal((60, 60)), height, width)
    speckle = 1 + 0.2 * rng.standard_normal((height, width))
    rug[:] = colors[pick] * np.clip(weave * wear * speckle, 0.3, 1.8)[..., None]


def _noise(rng: np.random.Generator, cells: tuple[int, ...] = (6, 24, 96, 384)) -> np.ndarray:
    """Return fractal noise with standard deviation about 1, shape (WALL_SIZE, WALL_SIZE), float32."""
    total = np.zeros((WALL_SIZE, WALL_SIZE), np.float32)
    for count in cells:
        total += _stretch(rng.standard_normal((count + 1, count + 1), dtype=np.float32))
    return total * np.float32(1.5 / np.sqrt(len(cells)))


def _stretch(grid: np.ndarray, height: int = WALL_SIZE, width: int = WALL_SIZE) -> np.ndarray:
    """Enlarge a small grid bilinearly."""
    for axis, length in ((0, height), (1, width)):
        position = np.linspace(0, grid.shape[axis] - 1.001, length, dtype=np.float32)
        low = position.astype(np.int32)
        share = (position - low).reshape((-1, 1) if axis == 0 else (1, -1))
        grid = np.take(grid, low, axis) * (1 - share) + np.take(grid, low + 1, axis) * share
    return grid


def _plain(color: tuple[float, float, float], shade: np.ndarray) -> np.ndarray:
    """Return a wall of one color times a shading, (n, n)."""
    return np.asarray(color, np.float32) * np.maximum(shade, 0.05)[..., None]


def _fall_off(top: float, bottom: float) -> np.ndarray:
    """Return the room's light on a wall: a gradient from top to bottom, darker in the corners."""
    t = np.linspace(-1, 1, WALL_SIZE, dtype=np.float32)
    corner = 1 - 0.45 * np.abs(t) ** 8
    return (top + (bottom - top) * (t[:, None] + 1) / 2) * corner[:, None] * corner[None, :]


def _frame(
    image: np.ndarray, box: tuple[int, int, int, int], color: np.ndarray | float, border: int
) -> np.ndarray:
    """Draw a border round (top, left, height, width), with a shadow under it; return the inside."""
    top, left, height, width = box
    image[top : top + height + 2 * border, left : left + width + 2 * border] *= 0.55
    image[top - border : top + height + border, left - border : left + width + border] = color
    return image[top : top + height, left : left + width]


def _light_up(canvas: np.ndarray, radiance: np.ndarray) -> None:
    """Fill a canvas, (h, w, 3), with a lamp that fades toward its rim: a hard rim would show steps."""
    t, s = (1 - np.linspace(-1, 1, size) ** 4 for size in canvas.shape[:2])
    canvas[:] = 0.3 + (t[:, None] * s)[..., None] * radiance


def _muted(color: np.ndarray) -> np.ndarray:
    """Return a color halfway to its gray: pigments are less pure than random numbers."""
    return 0.5 * (color + color.mean())
