"""Plain shapes made by code: boxes, cylinders, cones and balls in random sizes, colors and patterns."""

import colorsys

import numpy as np

from digs_warp.geometry.rigid import rotation_in_plane
from digs_warp.sim.scene.builtin.noise import mix, periodic_noise
from digs_warp.sim.scene.builtin.shapes import Patch, join_patches, revolve
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene

SEGMENTS = 48
TEXELS = 256
SHAPES = ("box", "cylinder", "cone", "ball")
PATTERNS = ("plain", "stripes", "checks", "speckles")

# Height in units of the radius, except of balls.
HEIGHTS = (0.6, 2.5)
# Radius of the top of a cone over that of its foot.
TAPER = (0.2, 0.7)


def plain_shape(rng: np.random.Generator, radius: float) -> Scene:
    """Return a shape that stands at the origin, as furniture.

    Args:
        rng: source of its form and finish.
        radius: of the upright cylinder around it [m].
    """
    patch = _form(SHAPES[rng.integers(len(SHAPES))], rng, radius)
    count = len(patch.faces)
    return Scene(
        vertices=patch.vertices.astype(np.float32),
        faces=patch.faces.astype(np.int32),
        face_materials=np.zeros(count, np.int32),
        normals=patch.normals.astype(np.float32),
        uvs=patch.uvs.astype(np.float32),
        vertex_colors=np.ones((len(patch.vertices), 3), np.float32),
        materials=(random_finish(rng),),
        face_objects=np.full(count, FURNITURE, np.int32),
    )


def _form(shape: str, rng: np.random.Generator, radius: float) -> Patch:
    height = radius * rng.uniform(*HEIGHTS)
    if shape == "box":
        corner = rng.uniform(0.25, 0.75) * np.pi / 2  # the diagonal of its plan fills the circle
        half = radius * np.array([np.cos(corner), np.sin(corner)])
        return _box(half, height, yaw=rng.uniform(0, np.pi))
    if shape == "ball":
        arc = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 1)
        return revolve(radius * np.column_stack([np.cos(arc), 1 + np.sin(arc)]), SEGMENTS)
    top = radius * (rng.uniform(*TAPER) if shape == "cone" else 1.0)
    outline = np.array([(0.0, 0.0), (radius, 0.0), (top, height), (0.0, height)])
    return join_patches([revolve(outline[i : i + 2], SEGMENTS) for i in range(3)])


def _box(half: np.ndarray, height: float, yaw: float) -> Patch:
    """Return a box of half sides ``half``, (2,), on the ground, with sharp edges."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    low = np.column_stack([corners @ rotation_in_plane(yaw).T, np.zeros(4)])
    high = low + (0, 0, height)
    sides = [np.array([low[i], low[i - 3], high[i - 3], high[i]]) for i in range(4)]
    return join_patches([_quad(each) for each in (*sides, high, low[::-1])])


def _quad(corners: np.ndarray) -> Patch:
    """Return a rectangle, corners counterclockwise from outside, (4, 3)."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    uvs = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float64)
    return Patch(corners, np.array([[0, 1, 2], [0, 2, 3]]), normals, uvs)


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
