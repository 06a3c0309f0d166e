"""Mirrors, glass, glow and textures of the surface, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.images import linear_from_srgb
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material
from reference.plates import plate
from reference.shading_scenes import (
    ABOVE,
    BLACK,
    FRONT,
    INTRINSICS,
    MATTE,
    floor,
    glow,
    linear_image,
    wall,
)

# ---- mirrors ----


def test_smooth_metal_mirrors_the_object() -> None:
    """The lamp's picture in the floor appears below it, at the height of its mirror image."""
    chrome = Material("chrome", np.ones(3, np.float32), roughness=0.0, metallic=1.0)
    lamp = plate((-0.3, 0, 0.15), (0, 0.05, 0), (0, 0, 0.05), glow(1.0))
    (u, v), _ = ABOVE.project(np.array([-0.3, 0.0, -0.15]))
    shown = {}
    for name, metal in {
        "smooth": chrome,
        "rough": replace(chrome, roughness=0.9),
        "plastic": replace(chrome, metallic=0.0),
    }.items():
        image = linear_image(RaycastRenderer(join_scenes(floor(metal), lamp), BLACK), ABOVE)
        shown[name] = image[int(v), int(u), 0]
    assert shown["smooth"] > 0.9
    assert shown["rough"] == 0 and shown["plastic"] == 0


def test_a_flat_mirror_shows_the_surround_at_its_distance() -> None:
    """The two eyes see a mirror image as far behind the mirror as its object is in front of it."""
    chrome = Material("chrome", np.ones(3, np.float32), roughness=0.0, metallic=1.0)
    radiance = np.full((64, 128, 3), 0.2, np.float32)
    radiance[30:34, 62:66] = 1.0  # a bright square straight behind the camera, at (4, 0, 0)
    renderer = RaycastRenderer(wall(chrome), Environment(radiance))
    columns = []
    for eye in (FRONT, FRONT.shifted_right(0.12)):
        row = linear_image(renderer, eye, 64)[45, :, 0]
        bright = np.maximum(row - 0.8, 0)
        columns.append((bright * (np.arange(160) + 0.5)).sum() / bright.sum())
    expected = INTRINSICS.fx * 0.12 / 5.0  # one metre to the mirror, four behind it
    assert columns[0] - columns[1] == pytest.approx(expected, abs=0.3)


# ---- glass and glow ----


def test_glass_tints_what_lies_behind() -> None:
    tint = np.array([0.5, 1.0, 0.25], np.float32)
    glass = Material("glass", tint, transmission=1.0, roughness=0.0)
    scene = join_scenes(wall(glass), wall(glow(0.8), x=-0.3, half=0.6))
    middle = linear_image(RaycastRenderer(scene, BLACK), FRONT)[45, 80]
    # The coat takes away 4 percent at right angles.
    np.testing.assert_allclose(middle, 0.8 * tint * 0.96, atol=0.012)


@pytest.mark.parametrize("panes", [1, 2, 3])
def test_panes_cover_with_their_opacity_one_after_the_other(panes: int) -> None:
    soot = Material("soot", np.zeros(3, np.float32), opacity=0.25, roughness=1.0)
    layers = [wall(soot, x=0.05 * i) for i in range(panes)]
    scene = join_scenes(*layers, wall(glow(1.0), x=-0.3, half=0.6))
    image, mask = RaycastRenderer(scene, BLACK).render_image(FRONT, 4)
    assert linear_from_srgb(image[45, 80, 0] / 255) == pytest.approx(0.75**panes, abs=0.01)
    assert mask[45, 80] == 255


# ---- textures of the surface ----


def encoded(normal: np.ndarray) -> np.ndarray:
    """A normal map that says the same everywhere."""
    pixel = np.rint(128 + 127 * normal).clip(0, 255).astype(np.uint8)
    return np.broadcast_to(pixel, (4, 4, 3)).copy()


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("tilt", [(0.5, 0.0), (0.0, 0.5), (-0.3, 0.4)])
def test_a_normal_map_shades_like_tilted_normals(tilt: tuple[float, float], mirrored: bool) -> None:
    """On a wall whose texture runs along y (or against it, mirrored) and z."""
    local = np.array([*tilt, np.sqrt(1 - tilt[0] ** 2 - tilt[1] ** 2)])
    shiny = replace(MATTE, roughness=0.3)
    smooth = wall(shiny)
    mapped = replace(smooth, materials=(replace(shiny, normal_texture=encoded(local)),))
    if mirrored:
        mapped = replace(mapped, uvs=mapped.uvs * np.array([-1, 1], np.float32))
    along_u = -1.0 if mirrored else 1.0
    world = np.array([local[2], along_u * local[0], local[1]], np.float32)
    tilted = replace(smooth, normals=np.tile(world, (4, 1)))
    sky = Environment((panorama_directions(64, 32) + 1).astype(np.float32))
    a, b, flat = (
        RaycastRenderer(s, sky).render_image(FRONT)[0].astype(int) for s in (mapped, tilted, smooth)
    )
    # Eight bits tilt a normal by a quarter of a degree, and openness goes by the vertex normals.
    assert np.abs(a - b).max() <= 8
    assert np.abs(b - flat).max() > 15
