"""Objects in another finish and turned: roughness and color change, metal and texture stay."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.scene.appearance import LookSettings, refinished, tint_color
from digs_warp.sim.scene.builtin import builtin_scene
from digs_warp.sim.scene.load import load_scene

SCENE = builtin_scene()
PYRAMID = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def test_roughness_is_multiplied_up_to_fully_rough() -> None:
    after = refinished(SCENE, LookSettings(roughness_factor=(1.3,)))
    pairs = list(zip(SCENE.materials, after.materials, strict=True))
    assert [b.roughness for _, b in pairs] == pytest.approx(
        [min(1.3 * a.roughness, 1.0) for a, _ in pairs]
    )
    assert all(a.metallic == b.metallic and a.texture is b.texture for a, b in pairs)


def test_roughness_of_a_texture_is_multiplied_and_its_metal_kept() -> None:
    finish = np.random.default_rng(0).integers(0, 256, (4, 6, 2), dtype=np.uint8)
    first, *others = SCENE.materials
    scene = replace(SCENE, materials=(replace(first, finish_texture=finish), *others))
    after, *_ = refinished(scene, LookSettings(roughness_factor=(1.7,))).materials
    assert after.finish_texture is not None
    wanted = np.minimum(np.rint(1.7 * finish[..., 0].astype(float)), 255)
    np.testing.assert_array_equal(after.finish_texture[..., 0], wanted)
    np.testing.assert_array_equal(after.finish_texture[..., 1], finish[..., 1])


@pytest.mark.parametrize(
    ("strength", "hue", "color"),
    [(0.0, 77.0, (1, 1, 1)), (1.0, 120.0, (0, 1, 0)), (0.4, -120.0, (0.6, 0.6, 1.0))],
)
def test_a_tint_takes_away_the_other_colors(
    strength: float, hue: float, color: tuple[float, float, float]
) -> None:
    assert tint_color(strength, hue) == pytest.approx(color)
    after = refinished(SCENE, LookSettings(tint=(strength,), tint_hue=(hue,)))
    for a, b in zip(SCENE.materials, after.materials, strict=True):
        np.testing.assert_allclose(b.base_color, a.base_color * np.array(color), atol=1e-6)


def test_every_object_gets_its_own_finish_and_furniture_none() -> None:
    """Where there are fewer values than objects, they repeat."""
    scene = replace(SCENE, face_objects=(SCENE.face_materials % 4).astype(np.int32))
    after = refinished(scene, LookSettings(tint=(1.0, 0.5), tint_hue=(0.0, 240.0)))
    colors = [(1, 1, 1), (1, 0, 0), (0.5, 0.5, 1), (1, 0, 0)]
    for number, (a, b) in enumerate(zip(scene.materials, after.materials, strict=True)):
        wanted = a.base_color * np.array(colors[number % 4])
        np.testing.assert_allclose(b.base_color, wanted, atol=1e-6)


def test_vertices_normals_and_pose_turn_counterclockwise(tmp_path: Path) -> None:
    path = tmp_path / "pyramid.obj"
    path.write_text(PYRAMID)
    scene = load_scene(path)
    after = scene.turned(np.pi / 6)
    x, y, z = scene.vertices.T.astype(np.float64)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    np.testing.assert_allclose(
        after.vertices, np.stack([c * x - s * y, s * x + c * y, z], 1), atol=1e-6
    )
    x, y, z = scene.normals.T.astype(np.float64)
    np.testing.assert_allclose(
        after.normals, np.stack([c * x - s * y, s * x + c * y, z], 1), atol=1e-6
    )

    (thing,) = after.objects
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 2)], np.float64)
    placed = corners @ thing.world_from_mesh[:3, :3].T + thing.world_from_mesh[:3, 3]
    there = np.unique(after.vertices.round(5), axis=0)
    np.testing.assert_allclose(np.unique(placed.round(5), axis=0), there, atol=2e-5)
    np.testing.assert_allclose(thing.size, np.ptp(after.vertices, axis=0), atol=1e-6)
    assert np.abs(thing.size - np.ptp(scene.vertices, axis=0)).max() > 0.1
