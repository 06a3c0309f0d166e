"""Objects in another finish and turned; light that is turned, dimmed and colored."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.render.environment_light import prepare_light
from digs_warp.sim.scene.appearance import (
    LUMINANCE,
    LookSettings,
    refinished,
    relit,
    temperature_color,
    tint_color,
    turned,
)
from digs_warp.sim.scene.builtin import builtin_scene
from digs_warp.sim.scene.environment import Environment, panorama_directions, solid_angles
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


RNG = np.random.default_rng(5)
SKY = Environment(RNG.uniform(0.1, 2.0, (16, 32, 3)).astype(np.float32))


def test_a_lamp_turns_counterclockwise_by_the_angle() -> None:
    directions = panorama_directions(720, 8)
    # A lamp 40 degrees wide that is brightest at azimuth 10.
    azimuth = np.rad2deg(np.arctan2(directions[..., 1], directions[..., 0]))
    lamp = np.clip(1 - np.abs(azimuth - 10) / 20, 0, 1)[..., None].repeat(3, 2).astype(np.float32)
    for angle in (30.0, 77.3, -45.1, 300.0):
        light = turned(lamp, angle)[..., 0]
        x, y = (light * directions[..., 0]).sum(), (light * directions[..., 1]).sum()
        after = np.rad2deg(np.arctan2(y, x))
        assert (after - 10 - angle + 180) % 360 - 180 == pytest.approx(0, abs=0.01)


def test_turning_loses_no_light_and_comes_round() -> None:
    for angle in (13.7, 200.2):
        after = turned(SKY.radiance, angle)
        np.testing.assert_allclose(after.sum(axis=1), SKY.radiance.sum(axis=1), rtol=1e-5)
    np.testing.assert_array_equal(turned(SKY.radiance, 360.0), SKY.radiance)
    half = 180 / 32 * 7  # three columns and a half
    expected = 0.5 * (np.roll(SKY.radiance, -3, 1) + np.roll(SKY.radiance, -4, 1))
    np.testing.assert_allclose(turned(SKY.radiance, half), expected, rtol=1e-5)


def test_a_room_turns_to_the_nearest_quarter() -> None:
    for angle, quarters in ((50.0, 1), (130.0, 1), (140.0, 2), (-50.0, 3), (30.0, 0)):
        after = relit(SKY, LookSettings(environment_turn=angle), has_corners=True)
        np.testing.assert_array_equal(after.radiance, np.roll(SKY.radiance, -8 * quarters, axis=1))


def test_less_light_leaves_the_exposure_alone() -> None:
    dim = relit(SKY, LookSettings(light_level=-1.5), has_corners=False)
    np.testing.assert_allclose(dim.radiance, 2**-1.5 * SKY.radiance, rtol=1e-6)
    assert prepare_light(dim)[0] == pytest.approx(prepare_light(SKY)[0], rel=1e-5)


@pytest.mark.parametrize(
    # Planck's law with the CIE 1931 observer; rows of the table by Charity, "What color is a blackbody?"
    ("kelvin", "x", "y"),
    [
        (2000, 0.5267, 0.4133),
        (3000, 0.4369, 0.4041),
        (4000, 0.3805, 0.3768),
        (10_000, 0.2807, 0.2884),
    ],
)
def test_light_has_the_color_of_a_black_body(kelvin: float, x: float, y: float) -> None:
    # The neutral light itself is the black body of 6500 K, whose chromaticity is (0.3135, 0.3237).
    xyz_from_srgb = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    neutral = np.linalg.solve(
        xyz_from_srgb, np.array([0.3135 / 0.3237, 1.0, (1 - 0.3135 - 0.3237) / 0.3237])
    )
    found = xyz_from_srgb @ (temperature_color(kelvin) * neutral)
    assert found[0] / found.sum() == pytest.approx(x, abs=2e-3)
    assert found[1] / found.sum() == pytest.approx(y, abs=2e-3)
    assert LUMINANCE @ temperature_color(kelvin) == pytest.approx(1)


def test_the_color_reaches_the_radiance_without_changing_its_luminance() -> None:
    gray = replace(SKY, radiance=SKY.radiance[..., :1].repeat(3, 2))
    warm = relit(gray, LookSettings(light_temperature=2700.0), has_corners=False)
    weights = solid_angles(32, 16)[..., None] * LUMINANCE
    assert (warm.radiance * weights).sum() == pytest.approx(
        (gray.radiance * weights).sum(), rel=1e-5
    )
    np.testing.assert_allclose(
        warm.radiance / gray.radiance,
        temperature_color(2700)[None, None] + 0 * gray.radiance,
        rtol=1e-5,
    )
