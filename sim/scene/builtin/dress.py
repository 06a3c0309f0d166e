"""The vase's dress: the outline of the body, the cloth around it, and the cord that ties the cloth."""

import numpy as np

from digs_warp.sim.scene.builtin.noise import smoothstep
from digs_warp.sim.scene.builtin.shapes import (
    Patch,
    angles,
    arc_length,
    grid_uvs,
    join_patches,
    ring_patch,
    smooth_curve,
    tube,
)

# Outlines (radius, z) [m], upward along the outside; that of the neck continues down the inside.
BOWL_OUTLINE = np.array(
    [
        (0.062, 0.027),
        (0.070, 0.032),
        (0.094, 0.062),
        (0.117, 0.105),
        (0.128, 0.150),
        (0.125, 0.190),
        (0.106, 0.235),
        (0.078, 0.266),
    ]
)
NECK_OUTLINE = np.array(
    [
        (0.078, 0.266),
        (0.056, 0.287),
        (0.047, 0.305),
        (0.0435, 0.328),
        (0.046, 0.352),
        (0.056, 0.376),
        (0.0665, 0.389),
        (0.0672, 0.3915),
        (0.0645, 0.3925),
        (0.053, 0.380),
        (0.042, 0.352),
        (0.0395, 0.328),
        (0.042, 0.305),
        (0.036, 0.280),
        (0.0, 0.262),
    ]
)

# The cloth [m]: heights above the floor of its hem, of the cord and of the upper edge.
HEM_HEIGHT = 0.105
TIE_HEIGHT = 0.288
TOP_HEIGHT = 0.322
CLOTH_THICKNESS = 0.0018
CORD_RADIUS = 0.0040

CLOTH_SEGMENTS = 240
CLOTH_ROWS = 45

# Pleats around the cloth: about as many as keep its width where the cord gathers it.
PLEATS = 17

# Position of the knot [rad], and lengths of the two tails [m].
KNOT_ANGLE = -1.15
TAIL_LENGTHS = (0.085, 0.105)


def body_radius(z: np.ndarray) -> np.ndarray:
    """Return the outer radius of bowl and neck at heights ``z`` [m]."""
    curve = np.concatenate([smooth_curve(BOWL_OUTLINE, 200), smooth_curve(NECK_OUTLINE[:7], 200)])
    return np.interp(z, curve[:, 1], curve[:, 0])


def cloth_patch() -> Patch:
    """Return the cloth as a thin shell: outside from hem to upper edge, turned in at both ends."""
    theta = angles(CLOTH_SEGMENTS)
    z, radius = _cloth_surface(theta, np.linspace(0, 1, CLOTH_ROWS))
    inner = np.maximum(radius - CLOTH_THICKNESS, 0)
    hem, tie = 5, int(CLOTH_ROWS * 0.81)
    # Inside of the hem downward, the whole outside upward, inside of the ruffle downward.
    order = [*range(hem, -1, -1), *range(CLOTH_ROWS), *range(CLOTH_ROWS - 1, tie, -1)]
    is_inner = np.array([True] * (hem + 1) + [False] * CLOTH_ROWS + [True] * (CLOTH_ROWS - 1 - tie))
    radii = np.where(is_inner[:, None], inner[order], radius[order])
    rows = np.stack([radii * np.cos(theta), radii * np.sin(theta), z[order]], axis=2)
    rows[:, -1] = rows[:, 0]

    unfolded = np.stack([radius.mean(axis=1), z.mean(axis=1)], axis=1)
    length = arc_length(unfolded)
    v = length / length[-1]
    return ring_patch(rows, grid_uvs(v[order], CLOTH_SEGMENTS))


def _cloth_surface(theta: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return height and radius of the outside [m], (rows, columns), at fractions ``s`` from hem to edge."""
    s = s[:, None]
    hem = HEM_HEIGHT + 0.004 * np.sin(2 * theta + 0.6) + 0.002 * np.sin(5 * theta)
    top = TOP_HEIGHT + 0.0025 * np.sin(3 * theta) + 0.0015 * np.sin(7 * theta + 1)
    z = hem + (top - hem) * s
    above = np.clip((z - TIE_HEIGHT) / (TOP_HEIGHT - TIE_HEIGHT), 0, 1.2)
    below = np.clip((TIE_HEIGHT - z) / (TIE_HEIGHT - HEM_HEIGHT), 0, 1.2)
    lying = np.minimum(body_radius(z), body_radius(np.array(TIE_HEIGHT)) + 10 * below)
    base = np.where(above > 0, body_radius(np.array(TIE_HEIGHT)) + 0.014 * above**1.3, lying)
    # Deepest close to the cord, flat over the belly, loose again at the hem.
    tied = 1 - 0.72 * np.exp(-(((z - TIE_HEIGHT) / 0.006) ** 2))
    depth = 0.0145 * smoothstep(0.46, 0.08, below) * tied + 0.004 * smoothstep(0.8, 1.0, below)
    depth = depth + 0.0012
    phase = PLEATS * theta + 0.8 * np.sin(3 * theta + 1) + 0.5 * np.sin(5 * theta) + 1.2 * s
    uneven = 1 + 0.22 * np.sin(4 * theta + 2) + 0.15 * np.sin(7 * theta)
    wave = np.sin(phase)
    fold = 0.5 + 0.65 * wave / np.sqrt(1 + 0.69 * wave * wave)  # rounder than a sine
    return z, base + CLOTH_THICKNESS + 0.0007 + depth * uneven * fold


def cord_patch() -> Patch:
    """Return the cord: a ring around the cloth, a knot, and two tails that end in tassels."""
    at_tie = body_radius(np.array(TIE_HEIGHT)) + CLOTH_THICKNESS + 0.0025
    theta = angles(240)
    ring = np.stack([np.cos(theta), np.sin(theta), np.zeros_like(theta)], axis=1)
    ring = ring * (at_tie + CORD_RADIUS) + (0, 0, TIE_HEIGHT)
    ring[-1] = ring[0]
    out = np.array([np.cos(KNOT_ANGLE), np.sin(KNOT_ANGLE), 0])
    across = np.array([-out[1], out[0], 0])
    center = out * (at_tie + 2.2 * CORD_RADIUS) + (0, 0, TIE_HEIGHT)
    patches = [_rope(ring, CORD_RADIUS), _rope(_trefoil(center, across, out), 0.0028)]
    for side, length in zip((-1, 1), TAIL_LENGTHS, strict=True):
        patches += _tail(center, KNOT_ANGLE, side, length)
    return join_patches(patches)


def _trefoil(center: np.ndarray, across: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Return the simplest knot, seen from the front, shape (121, 3)."""
    t = angles(120)
    x, y = np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t)
    local = np.outer(x, across) + np.outer(y, (0, 0, 1)) - np.outer(np.sin(3 * t), out)
    path = center + 0.0040 * local
    path[-1] = path[0]
    return path


def _tail(center: np.ndarray, angle: float, side: int, length: float) -> list[Patch]:
    """Return one end of the cord with its tassel, lying on the pleats."""
    s = np.linspace(0, 1, 6)
    turned = angle + side * (0.06 + 0.20 * s**0.7)
    z = TIE_HEIGHT - 0.004 - length * s
    _, cloth = _cloth_surface(np.linspace(0, 2 * np.pi, 400), np.linspace(0, 1, 60))
    heights = HEM_HEIGHT + (TOP_HEIGHT - HEM_HEIGHT) * np.linspace(0, 1, 60)
    # The pleats differ: the cord lies on the highest ones.
    reach = np.interp(z, heights, cloth.max(axis=1)) + 0.8 * CORD_RADIUS
    points = np.stack([reach * np.cos(turned), reach * np.sin(turned), z], axis=1)
    points[0] = center
    path = smooth_curve(points, 72)
    direction = (path[-1] - path[-6]) / np.linalg.norm(path[-1] - path[-6])
    t = np.linspace(0, 1, 20)
    tassel_path = path[-1] + np.outer(t * 0.034, direction)
    profile = np.interp(
        t,
        (0, 0.06, 0.14, 0.22, 0.30, 0.95, 1),
        (0, 0.0045, 0.0052, 0.0036, 0.0048, 0.0085, 0),
    )
    return [
        _rope(path, 0.0026),
        tube(tassel_path, profile[:, None], 14, uv_scale=(0.12, 2.5)),
    ]


def _rope(path: np.ndarray, radius: float) -> Patch:
    """Return a cord of two strands: an oval cross-section that twists along the path."""
    sides = 10
    length = arc_length(path)[:, None]
    turns = np.round(length[-1, 0] / (4.5 * radius))
    phase = angles(sides)[None, :] - np.pi * turns * length / length[-1]
    lobed = radius * (0.82 + 0.18 * np.cos(2 * phase))
    lobed[:, -1] = lobed[:, 0]
    return tube(path, lobed, sides, uv_scale=(0.1, 4.0))
