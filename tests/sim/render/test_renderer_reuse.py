"""Recordings of the same scene in one process share its renderer, and cannot tell."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.images import write_image
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.sim.render import raycast
from digs_warp.sim.render.environment_light import prepare_light
from digs_warp.sim.render.raycast import renderer_of
from digs_warp.sim.scene.builtin import builtin_scene, builtin_shape
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Scene
from reference.file_hashes import file_hashes
from reference.mesh_files import TETRAHEDRON

SKY = Environment(np.full((8, 16, 3), 0.5, np.float32))


@pytest.fixture(autouse=True)
def nothing_kept() -> Iterator[None]:
    raycast._kept.clear()
    yield
    raycast._kept.clear()


@pytest.fixture(scope="module")
def plain() -> Scene:
    return builtin_shape()


def test_equal_scenes_share_a_renderer(plain: Scene) -> None:
    first = renderer_of(plain, SKY)
    copy = replace(plain, vertices=plain.vertices.copy("K"))
    assert renderer_of(copy, replace(SKY, radiance=SKY.radiance.copy())) is first


def test_whatever_is_seen_tells_scenes_apart(plain: Scene) -> None:
    vertices = plain.vertices.copy()
    vertices[7, 2] += 1e-3
    red = replace(plain.materials[0], base_color=np.array([1, 0, 0], np.float32))
    shiny = replace(plain.materials[0], roughness=0.1)
    scenes = [
        *(plain, replace(plain, vertices=vertices)),
        *(replace(plain, materials=(each, *plain.materials[1:])) for each in (red, shiny)),
        replace(plain, face_materials=plain.face_materials[::-1]),
    ]
    bright = replace(SKY, radiance=SKY.radiance * 2)
    skies = [SKY, bright, replace(SKY, level=2.0), replace(SKY, radius=9.0), replace(SKY, floor=-1)]
    pairs = [*((scene, SKY) for scene in scenes), *((plain, sky) for sky in skies[1:])]
    renderers = [renderer_of(*pair) for pair in pairs]
    assert len({id(renderer) for renderer in renderers}) == len(pairs)


def test_those_used_last_are_kept_as_far_as_they_are_small(
    plain: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    skies = [replace(SKY, level=level) for level in (1.0, 2.0, 3.0)]
    first, second = (renderer_of(plain, sky) for sky in skies[:2])
    size = sum(size for _, size in raycast._kept.values()) // 2
    monkeypatch.setattr(raycast, "LARGEST", 2 * size)
    assert renderer_of(plain, skies[0]) is first
    third = renderer_of(plain, skies[2])
    assert [renderer for renderer, _ in raycast._kept.values()] == [first, third]
    assert renderer_of(plain, skies[1]) is not second
    raycast._kept.clear()
    monkeypatch.setattr(raycast, "LARGEST", size - 1)
    assert renderer_of(plain, SKY) is not renderer_of(plain, SKY)


def test_objects_in_the_same_surround_share_its_blurred_copies() -> None:
    radiance = np.random.default_rng(2).random((8, 16, 3), dtype=np.float32)
    skies = (Environment(radiance), Environment(radiance), Environment(radiance[::-1]))
    tables = (None, np.full(3, 0.2), None)
    lights = [prepare_light(sky, below=each)[1] for sky, each in zip(skies, tables, strict=True)]
    first, second, other = (light.specular.texels for light in lights)
    assert first.ptr == second.ptr and not np.array_equal(first.numpy(), other.numpy())


@pytest.fixture
def config(tmp_path: Path) -> SimulateConfig:
    """Of a small mesh on a table, in a surround of few pixels."""
    mesh, environment = tmp_path / "pyramid.obj", tmp_path / "day.png"
    mesh.write_text(TETRAHEDRON)
    write_image(environment, np.random.default_rng(1).integers(0, 256, (16, 32, 3), np.uint8))
    return SimulateConfig(
        profile="bare-matcher", mesh=mesh, environment=environment, frames=2, width=64, tier="law"
    )


def test_recordings_do_not_depend_on_those_before_or_beside_them(
    config: SimulateConfig, tmp_path: Path
) -> None:
    alone = pixels_of(config, tmp_path / "alone")
    simulate(replace(config, seed=8, samples_per_pixel=1), tmp_path / "another")
    (kept,) = raycast._kept.values()
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(lambda name: pixels_of(config, tmp_path / name), ("a", "b"))
    assert first == second == alone
    assert list(raycast._kept.values()) == [kept]


def pixels_of(config: SimulateConfig, folder: Path) -> dict[str, str]:
    """Record, and return the hashes of all images."""
    simulate(config, folder)
    hashes = file_hashes(folder)
    return {name: each for name, each in hashes.items() if name.endswith((".png", ".exr"))}


def test_the_built_in_object_cannot_be_changed() -> None:
    scene = builtin_scene()
    for array in (scene.vertices, scene.faces, scene.materials[0].texture):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
