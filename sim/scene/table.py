"""A table: a rounded top of oak laminate on four legs, made by code for the size of what stands on it."""

from functools import cache

import numpy as np

from digs_warp.sim.scene.finishes import mix, periodic_noise, smoothstep
from digs_warp.sim.scene.scene import Material, Scene
from digs_warp.sim.scene.shapes import Patch, furniture, join_patches

SEED = 11

# Name of the material of its top.
TABLE_TOP = "table top"

# Of a desk [m]: half its sides at least, thickness of the top, and radius of its rounded edge.
HALF_SIZE = np.array([0.7, 0.45])
THICKNESS = 0.028
EDGE_RADIUS = 0.006
EDGE_STEPS = 4

# Legs: side of their squares and distance from the edge [m].
LEG, LEG_INSET = 0.045, 0.05

# Wood beyond what stands on the table [m].
FREE_EDGE = 0.25

# Texels of the texture; 0.7 mm of a desk.
WIDTH, HEIGHT = 2048, 1344

# sRGB 0..1.
OAK_LIGHT = np.array((0.74, 0.60, 0.43), np.float32)
OAK_DARK = np.array((0.52, 0.37, 0.23), np.float32)
PORE = np.array((0.34, 0.23, 0.14), np.float32)


def table_scene(top: float, floor: float, things: np.ndarray) -> Scene:
    """Return a table as furniture.

    Args:
        top: height of its top [m].
        floor: height of the floor that it stands on [m].
        things: corners of the box around what stands on it, (2, 3) [m].
    """
    middle = things[:, :2].mean(axis=0)
    half = np.maximum(HALF_SIZE, np.ptp(things[:, :2], axis=0) / 2 + FREE_EDGE)
    board = _board(middle, half, top)
    legs = [
        _box(middle + sign * (half - LEG_INSET - LEG / 2), LEG / 2, floor, top - THICKNESS)
        for sign in np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    ]
    parts = (board, join_patches(legs))
    numbers = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
    return furniture(join_patches(parts), numbers, table_materials())


@cache
def table_materials() -> tuple[Material, Material]:
    """Return the laminate of the top and the paint of the legs, always the same; textures are read-only."""
    color, normals = oak_textures(np.random.default_rng(SEED))
    for texture in (color, normals):
        texture.flags.writeable = False
    white = np.ones(3, np.float32)
    top = Material(TABLE_TOP, white, color, roughness=0.3, normal_texture=normals)
    return top, Material("table legs", np.array((0.03, 0.03, 0.035), np.float32), roughness=0.5)


def oak_textures(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return oak with the grain along x, sRGB, and its normals, both (HEIGHT, WIDTH, 3), uint8."""
    shape = (HEIGHT, WIDTH)
    bend = periodic_noise(rng, shape, (150, 1300), slope=1.5, stretch=(1.0, 3.0))
    grain = periodic_noise(rng, shape, (6, 200), slope=0.8, stretch=(1.0, 16.0))
    fibres = periodic_noise(rng, shape, (2, 9), slope=0.0, stretch=(1.0, 10.0))
    pores = periodic_noise(rng, shape, (3, 14), slope=0.2, stretch=(1.0, 22.0))
    rows = np.arange(HEIGHT, dtype=np.float32)[:, None] / HEIGHT
    rings = np.sin(2 * np.pi * (14 * rows + 1.6 * bend))
    share = np.clip(0.42 + 0.16 * rings + 0.17 * grain + 0.08 * fibres, 0, 1)
    depth = smoothstep(1.5, 2.6, pores)
    color = mix(mix(OAK_LIGHT, OAK_DARK, share), PORE, 0.7 * depth)
    height = 0.25 * fibres - 1.5 * depth
    down, across = np.gradient(height)
    normals = np.stack([-0.05 * across, 0.05 * down, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return _bytes(color), np.rint(np.clip(128 + 127 * normals, 0, 255)).astype(np.uint8)


def _board(middle: np.ndarray, half: np.ndarray, top: float) -> Patch:
    """Return the top with its rounded edge; the grain runs on over the edge."""
    turn = np.linspace(0, np.pi / 2, EDGE_STEPS + 1)
    # From the flat part outward and down: distance beyond it, drop, and both parts of the normal.
    out = np.append(EDGE_RADIUS * np.sin(turn), EDGE_RADIUS)
    drop = np.append(EDGE_RADIUS * (1 - np.cos(turn)), THICKNESS)
    outward, upward = np.append(np.sin(turn), 1.0), np.append(np.cos(turn), 0.0)
    flat = half - EDGE_RADIUS
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
    faces = [_quad(signs * flat, np.zeros(4), (0, 0, 1))]
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
        side = (signs[a] + signs[b]) / 2
        for i in range(len(out) - 1):
            ends = [(a, i), (a, i + 1), (b, i + 1), (b, i)]
            places = np.array([signs[corner] * (flat + out[k]) for corner, k in ends])
            normals = [(*(outward[k] * side), upward[k]) for _, k in ends]
            faces.append(_quad(places, np.array([-drop[k] for _, k in ends]), normals))
    faces.append(_quad(signs[::-1] * half, np.full(4, -THICKNESS), (0, 0, -1)))
    whole = join_patches(faces)
    # Unfolded: what hangs down continues the picture of the top.
    away = np.clip(whole.vertices[:, :2], -flat, flat)
    over = np.sign(whole.vertices[:, :2]) * -whole.vertices[:, 2:]
    uvs = 0.5 + (away + np.where(np.abs(whole.normals[:, :2]) > 0.5, over, 0)) / (2 * half)
    place = np.array([*middle, top])
    return Patch(whole.vertices + place, whole.faces, whole.normals, uvs)


def _box(middle: np.ndarray, half: float, low: float, high: float) -> Patch:
    """Return an upright square box without ends."""
    signs = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
    heights = np.array([high, low, low, high])
    sides = []
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
        normal = (*((signs[a] + signs[b]) / (2 * half)), 0.0)
        sides.append(_quad(middle + signs[[a, a, b, b]], heights, normal))
    return join_patches(sides)


def _quad(places: np.ndarray, heights: np.ndarray, normals: object) -> Patch:
    """Return a face through four corners, (4, 2) and (4,), counterclockwise from outside."""
    vertices = np.column_stack([places, heights])
    return Patch(
        vertices=vertices,
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        normals=np.broadcast_to(np.asarray(normals, np.float64), (4, 3)).copy(),
        uvs=np.zeros((4, 2)),
    )


def _bytes(image: np.ndarray) -> np.ndarray:
    return np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)
