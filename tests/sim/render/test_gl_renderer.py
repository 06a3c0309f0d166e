"""OpenGL against the ray caster: two independent ways to the same depth, masks, ids and normals."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from digs_warp.device.libraries import MissingLibraryError
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.gl import GlRenderer
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.builtin import builtin_scene
from digs_warp.sim.scene.environment import Environment, set_up
from digs_warp.sim.scene.load import load_scene
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate

UP = np.array([0.0, 0.0, 1.0])
INTRINSICS = Intrinsics(321, 181, 300.0, 310.0, 158.3, 93.1)  # off center, on purpose
PAPER = Material("paper", np.ones(3, np.float32))
SKY = Environment(np.random.default_rng(0).uniform(0.2, 1.8, (16, 32, 3)).astype(np.float32))

DATA = Path(os.environ.get("DIGS_WARP_SAMPLE_DATA", "../shared/data"))
MESHES = sorted((Path(__file__).parents[3] / DATA / "meshes").glob("*/*.glb"))

MAX_DEPTH_ERROR = 1e-4  # relative, away from edges
MIN_MASK_IOU = 0.995
# Where inverse depth bends more than this from pixel to pixel [relative], there is an edge.
MAX_BEND = 1e-3


def gl_renderer(scene: Scene, environment: Environment = SKY) -> GlRenderer:
    try:
        return GlRenderer(scene, environment)
    except MissingLibraryError as error:
        pytest.skip(str(error))


def is_edge(depth: np.ndarray, materials: np.ndarray) -> np.ndarray:
    """Pixels beside a step, a crease or another material; inverse depth is linear on planes."""
    inverse = 1.0 / depth
    edge = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        before, after = np.roll(inverse, 1, axis), np.roll(inverse, -1, axis)
        edge |= np.abs(before + after - 2 * inverse) > MAX_BEND * inverse
        for shift in (-1, 1):
            edge |= np.roll(materials, shift, axis) != materials
    return edge


def assert_same_geometry(gl: GlRenderer, rays: RaycastRenderer, camera: Camera) -> None:
    gl_depth, _, gl_ids, _ = gl.render_geometry(camera)
    depth, _, ids, _ = rays.render_geometry(camera)
    here, there = gl_ids >= 0, ids >= 0
    assert (here & there).sum() >= MIN_MASK_IOU * (here | there).sum()
    inner = ~is_edge(depth, ids)
    assert (inner & there).sum() > 0.3 * there.sum()
    error = np.abs(gl_depth / depth - 1)[inner]
    assert error.max() <= MAX_DEPTH_ERROR, f"{(error > MAX_DEPTH_ERROR).sum()} of {inner.sum()}"
    assert (gl_ids == ids)[inner].all()


@pytest.mark.sample_data
@pytest.mark.long
@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_depth_masks_and_ids_agree_on_every_mesh(path: Path) -> None:
    scene = load_scene(path, size=0.5, up="y")  # lying flat, a sword is all outline
    eye = np.array([0.8, -0.6, 0.35]) * scene.radius / 0.3
    camera = Camera(INTRINSICS, look_at(eye, np.zeros(3), UP))
    assert_same_geometry(gl_renderer(scene), RaycastRenderer(scene, SKY), camera)


def test_the_built_in_object_on_its_floor_agrees_from_a_rolled_camera() -> None:
    scene, sky, _ = set_up(builtin_scene(), SKY, "floor", 1.0)
    pose = look_at(np.array([-0.5, 0.7, 0.3]), np.array([0.05, 0, 0.02]), np.array([0.3, 0.2, 1]))
    camera = Camera(INTRINSICS, pose)
    gl, rays = gl_renderer(scene, sky), RaycastRenderer(scene, sky)
    assert_same_geometry(gl, rays, camera)
    drawn, cast = gl.render_geometry(camera), rays.render_geometry(camera)
    inner = ~is_edge(cast.depth, cast.material_ids)
    cosine = (drawn.normals_world * cast.normals_world).sum(axis=-1)[inner]
    assert np.degrees(np.arccos(np.clip(np.median(cosine), -1, 1))) < 0.5
    assert (cosine > 0.9).mean() > 0.98
    sheet = plate((0, 0, 0), (0, 0.3, 0), (0, 0, 0.3), PAPER)
    gl_renderer(sheet).render_geometry(camera)
    gc.collect()  # pyrender shuts EGL down for the whole process when it frees a buffer
    np.testing.assert_array_equal(gl.render_geometry(camera).depth, drawn.depth)


def test_both_sides_of_a_sheet_are_there() -> None:
    sheet = plate((0, 0, 0), (0, 0.3, 0), (0, 0, 0.3), PAPER)
    gl, rays = gl_renderer(sheet), RaycastRenderer(sheet, SKY)
    for x in (1.0, -1.0):
        camera = Camera(INTRINSICS, look_at(np.array([x, 0, 0]), np.zeros(3), UP))
        assert_same_geometry(gl, rays, camera)
        view = gl.render_geometry(camera)
        np.testing.assert_allclose(
            view.normals_world[view.material_ids == 0] @ [x, 0, 0], 1.0, atol=1e-3
        )


def test_a_camera_that_nearly_touches_the_object() -> None:
    """The near plane cuts nothing off that is farther than 2 mm, and depth stays exact."""
    wall = plate((0, 0, 0), (0, 0.3, 0), (0, 0.1, 0.3), PAPER)
    rays = RaycastRenderer(wall, SKY)
    camera = Camera(INTRINSICS, look_at(np.array([0.004, 0, 0]), np.array([-1.0, 0, 0]), UP))
    assert rays.render_geometry(camera)[0].max() < 0.01
    assert_same_geometry(gl_renderer(wall), rays, camera)


def test_without_a_driver_the_message_names_the_packages_and_the_folder_is_untouched(
    tmp_path: Path,
) -> None:
    """A fresh process in which EGL finds no vendor's driver."""
    code = (
        "import sys; from pathlib import Path\n"
        "from digs_warp.sim.record.record import SimulateConfig, simulate\n"
        "simulate(SimulateConfig(renderer='gl', frames=1, width=8), Path(sys.argv[1]))\n"
    )
    without = {**os.environ, "__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"}
    result = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "capture")],
        check=False,
        env=without,
        capture_output=True,
        text=True,
        timeout=120,
    )
    last = result.stderr.strip().splitlines()[-1]
    assert result.returncode != 0
    assert last.startswith("digs_warp.device.libraries.MissingLibraryError")
    assert "libegl1 libgl1-mesa-dri" in last
    assert not (tmp_path / "capture").exists()
