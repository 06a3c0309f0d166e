"""A ball of Gaussians becomes the mesh of a ball; parts, masks, files."""

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.data.images import srgb_from_linear
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import quat_xyzw_from_matrix
from digs_warp.show.film.camera_path import Subject, orbit
from digs_warp.surface.depth_views import DepthView
from digs_warp.surface.extract import Scene, extract_surface, remove_floaters
from digs_warp.surface.files import write_mesh
from digs_warp.surface.fuse import fuse_views
from reference.optional import open3d_or_skip
from reference.tiny_capture import RADIUS, ball

VOXEL = 0.008
ORIGIN = np.zeros(3)
SCENE = Scene(ORIGIN, 1.2 * RADIUS)


@pytest.fixture(scope="module", autouse=True)
def open3d() -> None:
    open3d_or_skip()


def cameras(size: int = 96) -> list[Camera]:
    k = Intrinsics.from_fov(size, size, 40.0)
    subject = Subject(ORIGIN, RADIUS)
    return [c for elevation in (-60, -20, 20, 60) for c in orbit(subject, k, 8, elevation)]


@pytest.fixture(scope="module")
def mesh() -> TriangleMesh:
    return extract_surface(discs(), cameras(), SCENE, VOXEL).mesh


def discs(count: int = 4000) -> Gaussians:
    """The ball made of flat Gaussians that lie on it, as training makes them."""
    g = ball(count)
    normals = g.means / np.linalg.norm(g.means, axis=1, keepdims=True)
    first = np.cross(normals, (0.3, 0.5, 0.8))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(normals, first), normals], axis=-1)
    scales = np.log([0.01, 0.01, 0.001])
    return replace(g, quats=quat_xyzw_from_matrix(axes), log_scales=np.tile(scales, (count, 1)))


def exact_views(noise: float = 0.0) -> list[DepthView]:
    """A gray sphere in closed form: what the fusion alone has to get right."""
    rng = np.random.default_rng(0)
    views = []
    for camera in cameras(96):
        k = camera.intrinsics
        u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
        rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1)
        center = camera.cam_from_world[:3, 3]
        a, b = (rays**2).sum(-1), rays @ center
        with np.errstate(invalid="ignore"):
            depth = (b - np.sqrt(b**2 - a * (center @ center - RADIUS**2))) / a
        depth += noise * rng.normal(size=depth.shape)
        views.append(DepthView(camera, np.full((*depth.shape, 3), 0.25), depth.astype(np.float32)))
    return views


def test_exact_depth_gives_the_sphere_to_a_fraction_of_a_voxel() -> None:
    """What is left over: distances are taken along the line of sight, too long where it grazes."""
    found = fuse_views(exact_views(), VOXEL, ORIGIN, 1.2 * RADIUS)
    radii = np.linalg.norm(found.points_world, axis=1)
    assert abs(np.median(radii) - RADIUS) < 0.08 * VOXEL
    assert np.percentile(np.abs(radii - RADIUS), 95) < 0.25 * VOXEL
    np.testing.assert_allclose(found.colors, 0.25, atol=1e-3)


def test_gaussians_give_their_surface_and_colors(mesh: TriangleMesh) -> None:
    radii = np.linalg.norm(mesh.points_world, axis=1)
    outwards = np.einsum("ni,ni->n", mesh.normals(), mesh.points_world)
    assert (outwards > 0).mean() > 0.995
    # The skins of the discs lie in front of their centers, most at grazing angles.
    assert np.percentile(np.abs(radii - RADIUS), 95) < 1.25 * VOXEL
    directions = mesh.points_world / radii[:, None]
    covered = {tuple(np.round(3 * d).astype(int)) for d in directions}
    every = np.random.default_rng(0).normal(size=(2000, 3))
    every /= np.linalg.norm(every, axis=1, keepdims=True)
    assert {tuple(np.round(3 * d).astype(int)) for d in every} <= covered  # closed all around
    expected = 0.5 + 0.4 * np.sin(directions * [4.0, 5.0, 6.0])
    assert np.median(np.abs(mesh.colors - expected)) < 0.03


def joined(*parts: Gaussians) -> Gaussians:
    return Gaussians(*(np.concatenate([getattr(p, name) for p in parts]) for name in FIELDS))


def test_a_floater_is_left_out_and_counted() -> None:
    stray = ball(60)
    stray.means[:] = stray.means * 0.05 + (0.24, 0.0, 0.12)
    stray.log_scales[:] = np.log(0.004)
    result = extract_surface(joined(discs(), stray), cameras(), SCENE, VOXEL)
    assert result.removed_parts >= 1
    assert result.removed_triangles > 10
    assert np.linalg.norm(result.mesh.points_world, axis=1).max() < RADIUS + 2 * VOXEL


def test_parts_of_a_size_stay_together() -> None:
    """Two equal triangles, one speck of another pair, and a vertex that nothing uses."""
    points = np.concatenate([np.eye(3), np.eye(3) + 5, np.eye(3) + 9, np.ones((1, 3))])
    triangles = [[0, 1, 2], [0, 2, 1], [3, 4, 5], [5, 4, 3], [6, 7, 8]]
    mesh = TriangleMesh(points, np.array(triangles), np.zeros((10, 3)))
    half = remove_floaters(mesh, least_share=0.6)
    assert (half.removed_parts, half.removed_triangles, len(half.mesh)) == (1, 1, 4)
    np.testing.assert_array_equal(half.mesh.points_world, points[:6])
    np.testing.assert_array_equal(half.mesh.triangles, triangles[:4])
    assert len(remove_floaters(mesh, least_share=0.5).mesh) == 5
    empty = TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    assert remove_floaters(empty).removed_parts == 0


def test_masks_cut_the_mesh() -> None:
    """Every camera shows only the upper half of its image: the lowest part of the ball is never seen."""
    upper = np.zeros((96, 96), np.uint8)
    upper[:48] = 255
    level = [c for c in cameras() if abs(c.center_world[2]) < 0.4]
    masks = [lambda: upper] * len(level)
    result = extract_surface(discs(), level, SCENE, VOXEL, masks)
    whole = extract_surface(discs(), level, SCENE, VOXEL)
    assert result.mesh.points_world[:, 2].min() > whole.mesh.points_world[:, 2].min() + RADIUS / 4


def test_what_gives_no_surface_is_said() -> None:
    with pytest.raises(DigsError, match="cameras see none"):
        extract_surface(ball(), cameras()[:2], SCENE, VOXEL)  # three have to agree
    faint = ball()
    faint.opacity_logits[:] = -8
    with pytest.raises(DigsError, match="too faint"):
        extract_surface(faint, cameras(), SCENE, VOXEL)
    with pytest.raises(DigsError, match="use at least"):
        extract_surface(ball(), cameras(), SCENE, 1e-5)
    with pytest.raises(DigsError, match="voxel size"):
        extract_surface(ball(), cameras(), SCENE, -1.0)


def read_glb(path: Path) -> tuple[dict, dict[str, np.ndarray]]:
    """The JSON part, and the accessors of the only primitive by name, by the text of glTF 2.0."""
    data = path.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    document = json.loads(data[20 : 20 + size])
    body = data[28 + size :]
    primitive = document["meshes"][0]["primitives"][0]
    arrays = {}
    for name, number in {**primitive["attributes"], "indices": primitive["indices"]}.items():
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        raw = body[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        dtype = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[accessor["componentType"]]
        arrays[name] = np.frombuffer(raw, dtype).reshape(accessor["count"], -1)
    return document, arrays


def test_a_glb_is_y_up_with_linear_colors(tmp_path: Path) -> None:
    mesh = TriangleMesh(np.eye(3), np.array([[0, 1, 2]]), np.array([[0.1, 0.5, 0.9]] * 3))
    write_mesh(tmp_path / "a.glb", mesh)
    document, arrays = read_glb(tmp_path / "a.glb")
    np.testing.assert_array_equal(arrays["POSITION"], [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    np.testing.assert_allclose(arrays["NORMAL"], np.array([[1, 1, -1]] * 3) / 3**0.5, rtol=1e-6)
    srgb = srgb_from_linear(arrays["COLOR_0"][:, :3] / 65535.0)
    np.testing.assert_allclose(srgb, mesh.colors, atol=1e-4)
    assert (arrays["COLOR_0"][:, 3] == 65535).all()
    assert document["accessors"][0]["max"] == [1, 1, 0]


def test_other_readers_take_our_files(tmp_path: Path, mesh: TriangleMesh) -> None:
    from digs_warp.sim.scene.load import load_scene

    for name in ("a.glb", "a.ply"):
        write_mesh(tmp_path / name, mesh)
        size, up = (
            float(np.ptp(mesh.points_world, axis=0).max()),
            {"a.glb": "y", "a.ply": "z"}[name],
        )
        scene = load_scene(tmp_path / name, size=size, up=up)
        np.testing.assert_allclose(
            np.ptp(scene.vertices, 0), np.ptp(mesh.points_world, 0), rtol=1e-4
        )
        assert len(scene.faces) > 0.99 * len(mesh)
    colored = trimesh.load(tmp_path / "a.ply", force="mesh", process=False)
    assert isinstance(colored, trimesh.Trimesh)
    np.testing.assert_allclose(colored.vertices, mesh.points_world, atol=1e-6)
    shown = np.asarray(colored.visual.vertex_colors)[:, :3] / 255.0  # pyright: ignore
    np.testing.assert_allclose(shown, mesh.colors, atol=0.5 / 255 + 1e-6)


def test_meshes_that_cannot_be_written(tmp_path: Path, mesh: TriangleMesh) -> None:
    with pytest.raises(DigsError, match=r"expected \.glb or \.ply"):
        write_mesh(tmp_path / "a.obj", mesh)
    empty = TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    with pytest.raises(DigsError, match="0 triangles"):
        write_mesh(tmp_path / "a.glb", empty)
    assert list(tmp_path.iterdir()) == []
