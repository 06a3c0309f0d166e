"""The built-in object: a glazed vase dressed in a kilim, tied with a cord, under a thin brass handle."""

from dataclasses import replace

import numpy as np

from digs_warp.sim.scene.finishes import smoothstep
from digs_warp.sim.scene.shapes import (
    Patch,
    angles,
    arc_length,
    grid_uvs,
    join_patches,
    revolve,
    ring_patch,
)

# Sides of the rings of the turned parts.
SEGMENTS = 84

# fmt: off
# Outlines, (radius, z) [m], upward along the outside; that of the neck continues down the inside.
FOOT_OUTLINE = np.array([
    (0.0, 0.0), (0.04, 0.0), (0.078, 0.0), (0.0815, 0.0025), (0.0815, 0.008), (0.077, 0.011),
    (0.0745, 0.014), (0.077, 0.018), (0.0785, 0.022), (0.0765, 0.0265), (0.072, 0.028), (0.05, 0.0285),
])
BOWL_OUTLINE = np.array([
    (0.062, 0.027), (0.070, 0.032), (0.094, 0.062), (0.117, 0.105), (0.128, 0.150), (0.125, 0.190),
    (0.106, 0.235), (0.078, 0.266),
])
NECK_OUTLINE = np.array([
    (0.078, 0.266), (0.056, 0.287), (0.047, 0.305), (0.0435, 0.328), (0.046, 0.352), (0.056, 0.376),
    (0.0665, 0.389), (0.0672, 0.3915), (0.0645, 0.3925), (0.053, 0.380), (0.042, 0.352),
    (0.0395, 0.328), (0.042, 0.305), (0.036, 0.280), (0.0, 0.262),
])
# (x, z) of the handle from a loop to the top [m]; the other half is its mirror image.
HANDLE_POINTS = np.array([
    (0.0540, 0.3290), (0.0590, 0.3285), (0.0680, 0.3400), (0.0830, 0.3750), (0.0930, 0.4150),
    (0.0870, 0.4550), (0.0600, 0.4830), (0.0000, 0.4940),
])
# fmt: on

# Brass and cane [m]: the collar under the lip with a loop on either side, and the handle in them.
COLLAR_RADIUS, COLLAR_HEIGHT, LOOP_RADIUS = 0.0455, 0.333, 0.0065
WIRE_RADIUS, GRIP_RADIUS, CANE_WIDTH = 0.0024, 0.0062, 0.0042

# The cloth [m]: heights above the floor of its hem, of the cord and of the upper edge.
HEM_HEIGHT, TIE_HEIGHT, TOP_HEIGHT = 0.105, 0.288, 0.322
CLOTH_THICKNESS, CLOTH_SEGMENTS, CLOTH_ROWS = 0.0018, 240, 45
CORD_RADIUS = 0.0040

# Pleats around the cloth: about as many as keep its width where the cord gathers it.
PLEATS = 17

# Position of the knot [rad], and lengths of the two tails [m].
KNOT_ANGLE, TAIL_LENGTHS = -1.15, (0.085, 0.105)

# Which of the patches is the neck.
NECK = 2


def smooth_curve(points: np.ndarray, count: int) -> np.ndarray:
    """Return ``count`` points spaced evenly along a curve through ``points``, shape (k, d) -> (count, d).

    The curve is a centripetal Catmull-Rom spline: it passes through every point and does not overshoot.
    """
    padded = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    knots = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(padded, axis=0), axis=1) ** 0.5)])
    t = np.linspace(knots[1], knots[-2], 24 * count)
    i = np.clip(np.searchsorted(knots, t, side="right") - 1, 1, len(padded) - 3)

    def between(a: np.ndarray, b: np.ndarray, first: int, last: int) -> np.ndarray:
        low, high = knots[i + first], knots[i + last]
        share = ((t - low) / (high - low))[:, None]
        return (1 - share) * a + share * b

    a1, a2, a3 = (between(padded[i + k], padded[i + k + 1], k, k + 1) for k in (-1, 0, 1))
    curve = between(between(a1, a2, -1, 1), between(a2, a3, 0, 2), 0, 1)
    length = arc_length(curve)
    even = np.linspace(0, length[-1], count)
    return np.stack([np.interp(even, length, axis) for axis in curve.T], axis=1)


_NECK_PROFILE = smooth_curve(NECK_OUTLINE, 40)

# Row of the neck that is the lip.
LIP_ROW = int(_NECK_PROFILE[:, 1].argmax())


def vase_patches() -> list[Patch]:
    """Return foot, bowl, neck, cloth, cord, brass and grip [m]; one material each, in this order."""
    foot = revolve(smooth_curve(FOOT_OUTLINE, 28), SEGMENTS)
    # Its texture covers the outline from bottom to top exactly once.
    foot = replace(foot, uvs=grid_uvs(np.linspace(0, 1, 28), SEGMENTS).reshape(-1, 2))
    bowl = revolve(smooth_curve(BOWL_OUTLINE, 24), SEGMENTS)
    neck = revolve(_NECK_PROFILE, SEGMENTS)
    handle = smooth_curve(np.concatenate([HANDLE_POINTS, HANDLE_POINTS[-2::-1] * (-1, 1)]), 121)
    path = np.stack([handle[:, 0], np.zeros(len(handle)), handle[:, 1]], axis=1)
    return [foot, bowl, neck, _cloth(), _cord(), _brass_wire(path), _grip(path)]


def _brass_wire(path: np.ndarray) -> Patch:
    """Collar, the two loops on it and the handle that hangs in them."""
    ring = _ring(SEGMENTS)
    standing = ring[::3, [0, 2, 1]] * LOOP_RADIUS + (COLLAR_RADIUS + LOOP_RADIUS, 0, COLLAR_HEIGHT)
    thickness = np.full((len(path), 1), WIRE_RADIUS)
    thickness[[0, -1]] = 0  # closed ends
    return join_patches(
        [
            _tube(ring * COLLAR_RADIUS + (0, 0, COLLAR_HEIGHT), 0.0026, 10),
            *(_tube(standing * (side, 1, 1), 0.0017, 8) for side in (1, -1)),
            _tube(path, thickness, 10),
        ]
    )


def _grip(path: np.ndarray) -> Patch:
    """The cane wound around the middle of the handle, each winding a low ridge."""
    middle = smooth_curve(path[42:79], 170)
    ridge = np.abs(np.sin(np.pi * arc_length(middle)[:, None] / CANE_WIDTH))
    radius = GRIP_RADIUS * (0.88 + 0.12 * ridge)
    radius[[0, -1]] = WIRE_RADIUS
    return _tube(middle, radius, 12, uv_scale=(0.1, 3.0))


def _cloth() -> Patch:
    """A thin shell: outside from hem to upper edge, turned in at both ends."""
    theta = angles(CLOTH_SEGMENTS)
    z, radius = _cloth_surface(theta, np.linspace(0, 1, CLOTH_ROWS))
    inner = np.maximum(radius - CLOTH_THICKNESS, 0)
    hem, tie = 5, int(CLOTH_ROWS * 0.81)
    # Inside of the hem downward, the whole outside upward, inside of the ruffle downward.
    order = [*range(hem, -1, -1), *range(CLOTH_ROWS), *range(CLOTH_ROWS - 1, tie, -1)]
    is_inner = np.repeat([True, False, True], [hem + 1, CLOTH_ROWS, CLOTH_ROWS - 1 - tie])
    radii = np.where(is_inner[:, None], inner[order], radius[order])
    rows = np.stack([radii * np.cos(theta), radii * np.sin(theta), z[order]], axis=2)
    rows[:, -1] = rows[:, 0]
    length = arc_length(np.stack([radius.mean(axis=1), z.mean(axis=1)], axis=1))
    return ring_patch(rows, grid_uvs((length / length[-1])[order], CLOTH_SEGMENTS))


def _cloth_surface(theta: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return height and radius of the outside [m], (rows, columns), at fractions ``s`` from hem to edge."""
    s = s[:, None]
    hem = HEM_HEIGHT + 0.004 * np.sin(2 * theta + 0.6) + 0.002 * np.sin(5 * theta)
    top = TOP_HEIGHT + 0.0025 * np.sin(3 * theta) + 0.0015 * np.sin(7 * theta + 1)
    z = hem + (top - hem) * s
    above = np.clip((z - TIE_HEIGHT) / (TOP_HEIGHT - TIE_HEIGHT), 0, 1.2)
    below = np.clip((TIE_HEIGHT - z) / (TIE_HEIGHT - HEM_HEIGHT), 0, 1.2)
    tied_radius = _body_radius(np.array(TIE_HEIGHT))
    lying = np.minimum(_body_radius(z), tied_radius + 10 * below)
    base = np.where(above > 0, tied_radius + 0.014 * above**1.3, lying)
    # Deepest close to the cord, flat over the belly, loose again at the hem.
    tied = 1 - 0.72 * np.exp(-(((z - TIE_HEIGHT) / 0.006) ** 2))
    depth = 0.0145 * smoothstep(0.46, 0.08, below) * tied + 0.004 * smoothstep(0.8, 1.0, below)
    depth = depth + 0.0012
    phase = PLEATS * theta + 0.8 * np.sin(3 * theta + 1) + 0.5 * np.sin(5 * theta) + 1.2 * s
    uneven = 1 + 0.22 * np.sin(4 * theta + 2) + 0.15 * np.sin(7 * theta)
    wave = np.sin(phase)
    fold = 0.5 + 0.65 * wave / np.sqrt(1 + 0.69 * wave * wave)  # rounder than a sine
    return z, base + CLOTH_THICKNESS + 0.0007 + depth * uneven * fold


def _body_radius(z: np.ndarray) -> np.ndarray:
    """Return the outer radius of bowl and neck at heights ``z`` [m]."""
    curve = np.concatenate([smooth_curve(BOWL_OUTLINE, 200), smooth_curve(NECK_OUTLINE[:7], 200)])
    return np.interp(z, curve[:, 1], curve[:, 0])


def _cord() -> Patch:
    """A ring around the cloth, a knot (a trefoil), and two tails that end in tassels."""
    at_tie = _body_radius(np.array(TIE_HEIGHT)) + CLOTH_THICKNESS + 0.0025
    ring = _ring(240) * (at_tie + CORD_RADIUS) + (0, 0, TIE_HEIGHT)
    out = np.array([np.cos(KNOT_ANGLE), np.sin(KNOT_ANGLE), 0])
    across = np.array([-out[1], out[0], 0])
    center = out * (at_tie + 2.2 * CORD_RADIUS) + (0, 0, TIE_HEIGHT)
    t = angles(120)
    x, y = np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t)
    local = np.outer(x, across) + np.outer(y, (0, 0, 1)) - np.outer(np.sin(3 * t), out)
    knot = center + 0.0040 * local
    knot[-1] = knot[0]
    tails = [_tail(center, *each) for each in zip((-1, 1), TAIL_LENGTHS, strict=True)]
    return join_patches([_rope(ring, CORD_RADIUS), _rope(knot, 0.0028), *tails[0], *tails[1]])


def _tail(center: np.ndarray, side: int, length: float) -> list[Patch]:
    """One end of the cord with its tassel, lying on the pleats."""
    s = np.linspace(0, 1, 6)
    turned = KNOT_ANGLE + side * (0.06 + 0.20 * s**0.7)
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
    knots, radii = (0, 0.06, 0.14, 0.22, 0.30, 0.95, 1), (0, 45, 52, 36, 48, 85, 0)
    tassel = np.interp(t, knots, np.array(radii) / 1e4)[:, None]
    hanging = path[-1] + np.outer(t * 0.034, direction)
    return [_rope(path, 0.0026), _tube(hanging, tassel, 14, uv_scale=(0.12, 2.5))]


def _rope(path: np.ndarray, radius: float) -> Patch:
    """A cord of two strands: an oval cross-section that twists along the path."""
    sides = 10
    length = arc_length(path)[:, None]
    turns = np.round(length[-1, 0] / (4.5 * radius))
    phase = angles(sides)[None, :] - np.pi * turns * length / length[-1]
    lobed = radius * (0.82 + 0.18 * np.cos(2 * phase))
    lobed[:, -1] = lobed[:, 0]
    return _tube(path, lobed, sides, uv_scale=(0.1, 4.0))


def _ring(segments: int) -> np.ndarray:
    """Return a unit circle in the x-y plane whose last point is exactly the first, (segments + 1, 3)."""
    theta = angles(segments)
    ring = np.stack([np.cos(theta), np.sin(theta), np.zeros_like(theta)], axis=1)
    ring[-1] = ring[0]
    return ring


def _tube(
    path: np.ndarray,
    radius: np.ndarray | float,
    sides: int,
    uv_scale: tuple[float, float] = (1.0, 1.0),
) -> Patch:
    """Return a tube along a curve.

    Args:
        path: shape (k, 3); for a closed curve the last point repeats the first.
        radius: one number, one per point (k, 1), or one per vertex (k, sides + 1) [m].
        sides: of the cross-section.
        uv_scale: turns of the texture around the tube, and v per metre along it.
    """
    first, second = _frames(path)
    phi = angles(sides)
    circle = first[:, None] * np.cos(phi)[:, None] + second[:, None] * np.sin(phi)[:, None]
    radius = np.broadcast_to(np.asarray(radius, np.float64), (len(path), sides + 1))
    rows = path[:, None] + circle * radius[..., None]
    rows[:, -1] = rows[:, 0]
    return ring_patch(rows, grid_uvs(arc_length(path) * uv_scale[1], sides, uv_scale[0]))


def _frames(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit normals per point that turn as little as possible along the path.

    The frame of one point is carried to the next by two reflections (Wang et al., "Computation of Rotation
    Minimizing Frames", 2008). On a closed path the remaining twist is distributed evenly.
    """
    closed = bool(np.linalg.norm(path[0] - path[-1]) < 1e-9)
    tangent = np.gradient(path, axis=0)
    if closed:
        tangent[0] = tangent[-1] = path[1] - path[-2]
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    first = np.empty_like(path)
    helper = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    first[0] = np.cross(tangent[0], helper) / np.linalg.norm(np.cross(tangent[0], helper))
    for k in range(len(path) - 1):
        step = path[k + 1] - path[k]
        square = step @ step
        normal = first[k] - 2 / square * (step @ first[k]) * step
        carried = tangent[k] - 2 / square * (step @ tangent[k]) * step
        mirror = tangent[k + 1] - carried
        square = mirror @ mirror
        first[k + 1] = normal - (2 / square * (mirror @ normal) * mirror if square > 0 else 0)
    second = np.cross(tangent, first)
    if closed:
        twist = np.arctan2(first[-1] @ second[0], first[-1] @ first[0])
        angle = -twist * np.linspace(0, 1, len(path))[:, None]
        first, second = (
            np.cos(angle) * first + np.sin(angle) * second,
            np.cos(angle) * second - np.sin(angle) * first,
        )
    return first, second
