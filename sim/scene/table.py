"""A table: a rounded top of oak laminate on four legs, as large as what stands on it asks for."""

from functools import cache
from pathlib import Path

import numpy as np

from digs_warp.data.images import read_image
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene

# Seamless, its grain along x, 0.7 mm for a texel of a desk; made by code (see docs/install.md).
OAK = Path(__file__).parent / "assets/oak.webp"

# Of a desk [m]: half its sides at least, thickness of the top, and radius of its rounded edge.
HALF_SIZE = np.array([0.7, 0.45])
THICKNESS = 0.028
EDGE_RADIUS = 0.006
EDGE_STEPS = 4

# Legs: side of their squares and distance from the edge [m].
LEG, LEG_INSET = 0.045, 0.05

# Wood beyond what stands on the table [m].
FREE_EDGE = 0.25

# Corners of a rectangle around the origin, counterclockwise from above, and the next one of each.
SIGNS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
NEXT = (1, 2, 3, 0)

Quads = tuple[np.ndarray, np.ndarray]
"""Corners, counterclockwise from outside, and their normals, (n, 4, 3) each."""


def table_scene(top: float, floor: float, things: np.ndarray) -> Scene:
    """Return a table as furniture.

    Args:
        top: height of its top [m].
        floor: height of the floor that it stands on [m].
        things: corners of the box around what stands on it, (2, 3) [m].
    """
    half = np.maximum(HALF_SIZE, np.ptp(things[:, :2], axis=0) / 2 + FREE_EDGE)
    board = _board(half)
    legs = [_leg(each, floor - top) for each in SIGNS * (half - LEG_INSET - LEG / 2)]
    corners, normals = (np.concatenate(part) for part in zip(board, *legs, strict=True))
    uvs = np.zeros((*corners.shape[:2], 2))
    uvs[: len(board[0])] = _unfolded(*board, half)
    places = corners + [*things[:, :2].mean(axis=0), top]
    faces = 4 * np.arange(len(corners))[:, None, None] + [[0, 1, 2], [0, 2, 3]]
    is_leg = np.arange(len(corners)) >= len(board[0])
    return Scene(
        vertices=places.reshape(-1, 3).astype(np.float32),
        faces=faces.reshape(-1, 3).astype(np.int32),
        face_materials=np.repeat(is_leg, 2).astype(np.int32),
        normals=normals.reshape(-1, 3).astype(np.float32),
        uvs=uvs.reshape(-1, 2).astype(np.float32),
        vertex_colors=np.ones((corners.size // 3, 3), np.float32),
        materials=_materials(),
        face_objects=np.full(2 * len(corners), FURNITURE, np.int32),
    )


@cache
def _materials() -> tuple[Material, Material]:
    """Return the laminate of the top and the paint of the legs."""
    oak = np.ascontiguousarray(read_image(OAK)[..., :3])
    oak.flags.writeable = False
    top = Material("table top", np.ones(3, np.float32), oak, roughness=0.3)
    return top, Material("table legs", np.array((0.03, 0.03, 0.035), np.float32), roughness=0.5)


def _board(half: np.ndarray) -> Quads:
    """Return the top with its rounded edge, around the middle of its upper side."""
    turn = np.linspace(0, np.pi / 2, EDGE_STEPS + 1)
    # From the flat part outward and down: distance beyond it, drop, and both parts of the normal.
    out = np.append(EDGE_RADIUS * np.sin(turn), EDGE_RADIUS)
    drop = np.append(EDGE_RADIUS * (1 - np.cos(turn)), THICKNESS)
    outward, upward = np.append(np.sin(turn), 1.0), np.append(np.cos(turn), 0.0)
    rings = SIGNS[None] * (half - EDGE_RADIUS + out[:, None, None])
    rings = np.concatenate([rings, np.broadcast_to(-drop[:, None, None], (*rings.shape[:2], 1))], 2)
    corners, normals = [rings[0]], [np.tile((0.0, 0.0, 1.0), (4, 1))]
    for a, b in enumerate(NEXT):
        side = (SIGNS[a] + SIGNS[b]) / 2
        slopes = np.column_stack([outward[:, None] * side, upward])
        for i in range(len(out) - 1):
            corners.append(rings[[i, i + 1, i + 1, i], [a, a, b, b]])
            normals.append(slopes[[i, i + 1, i + 1, i]])
    corners.append(rings[-1, ::-1])
    normals.append(np.tile((0.0, 0.0, -1.0), (4, 1)))
    return np.stack(corners), np.stack(normals)


def _unfolded(corners: np.ndarray, normals: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return texture coordinates, (n, 4, 2): what hangs down continues the picture of the top."""
    flat = half - EDGE_RADIUS
    away = np.clip(corners[..., :2], -flat, flat)
    over = np.sign(corners[..., :2]) * -corners[..., 2:]
    return 0.5 + (away + np.where(np.abs(normals[..., :2]) > 0.5, over, 0)) / (2 * half)


def _leg(middle: np.ndarray, foot: float) -> Quads:
    """Return an upright square box without ends, from the board down to the height ``foot``."""
    heights = np.array([-THICKNESS, foot, foot, -THICKNESS])[:, None]
    corners, normals = [], []
    for a, b in enumerate(NEXT):
        corners.append(np.hstack([middle + LEG / 2 * SIGNS[[a, a, b, b]], heights]))
        normals.append(np.tile([*(SIGNS[a] + SIGNS[b]) / 2, 0.0], (4, 1)))
    return np.stack(corners), np.stack(normals)
