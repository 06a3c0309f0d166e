"""Which places cameras see: a plate before a plane, against every triangle one by one in float64."""

import numpy as np
import trimesh

from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.measure.surface_metrics import EDGE_ON, visible_places


def mesh_of(found: trimesh.Trimesh) -> TriangleMesh:
    return TriangleMesh(found.vertices, found.faces, np.ones_like(found.vertices))


def hits(center: np.ndarray, place: np.ndarray, mesh: TriangleMesh) -> bool:
    """Return whether a triangle lies before a place: the twin of the kernel (Moeller and Trumbore)."""
    a, b, c = (mesh.points_world[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    toward = np.broadcast_to(place - center, a.shape)
    across = np.cross(toward, c - a)
    volume = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", center - a, across) / volume
        beside = np.cross(center - a, b - a)
        v = np.einsum("ij,ij->i", toward, beside) / volume
        share = np.einsum("ij,ij->i", c - a, beside) / volume
    return bool(np.any((u >= 0) & (v >= 0) & (u + v <= 1) & (share > 0) & (share < 0.999)))


def scene() -> tuple[TriangleMesh, np.ndarray, np.ndarray]:
    """A bumpy sphere, places on all of it, and normals."""
    ball = trimesh.creation.icosphere(2, 0.2)
    bumps = 1.0 + 0.3 * np.sin(5.0 * ball.vertices / 0.2).prod(axis=1, keepdims=True)
    ball.vertices *= bumps
    mesh = mesh_of(ball)
    return mesh, mesh.points_world[mesh.triangles].mean(axis=1), ball.face_normals


def looking_down(height: float) -> Camera:
    """A camera on the z axis that looks at the origin."""
    world_from_cam = np.diag([1.0, -1.0, -1.0, 1.0])
    world_from_cam[2, 3] = height
    return Camera(Intrinsics.from_fov(64, 48, 30.0), world_from_cam)


def test_what_is_hidden_agrees_with_every_triangle_one_by_one() -> None:
    mesh, places, normals = scene()
    camera = looking_down(1.0)
    px, _ = camera.project(places)
    inside = np.all((px >= 0) & (px < [64, 48]), axis=1)
    toward = places - camera.center_world
    sine = np.abs((toward * normals).sum(axis=1)) / np.linalg.norm(toward, axis=1)
    clear = [not hits(camera.center_world, place, mesh) for place in places]
    expected = clear & inside & (sine >= EDGE_ON)
    found = visible_places(places, normals, mesh, [camera])
    assert 0.1 < found.mean() < 0.6
    np.testing.assert_array_equal(found, expected)


def test_a_place_outside_the_image_or_behind_the_camera_is_not_seen() -> None:
    mesh, places, normals = scene()
    assert not visible_places(places + [0.0, 5.0, 0.0], normals, mesh, [looking_down(1.0)]).any()
    assert not visible_places(places, normals, mesh, [looking_down(-1.0)]).any()
    assert not visible_places(places, normals, mesh, []).any()
