"""Distances between points and a surface, against shapes whose answer is known."""

import numpy as np
import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.measure.surface_metrics import (
    EDGE_ON,
    distances_to_surface,
    sample_surface,
    surface_score,
    visible_places,
)


def square(side: float = 1.0) -> TriangleMesh:
    """A square in the plane z = 0, one corner at the origin; its two triangles differ in no area."""
    points = np.array([[0, 0, 0], [side, 0, 0], [side, side, 0], [0, side, 0]], np.float32)
    return TriangleMesh(points, np.array([[0, 1, 2], [0, 2, 3]]), np.ones((4, 3)))


def distance_to_square(points: np.ndarray) -> np.ndarray:
    """The distance to `square`, by clamping."""
    nearest = points.copy()
    nearest[:, :2] = np.clip(points[:, :2], 0, 1)
    nearest[:, 2] = 0
    return np.linalg.norm(points - nearest, axis=1)


def test_the_distance_is_that_to_faces_edges_and_corners() -> None:
    points = np.random.default_rng(0).uniform(-2, 3, size=(500, 3))
    found = distances_to_surface(points, square())
    np.testing.assert_allclose(found, distance_to_square(points), atol=1e-6)


def test_samples_are_even_by_area() -> None:
    wide = TriangleMesh(
        np.array([[0, 0, 0], [3, 0, 0], [0, 1, 0], [0, 0, 5], [1, 0, 5], [0, 1, 5]], np.float32),
        np.array([[0, 1, 2], [3, 4, 5]]),
        np.ones((6, 3)),
    )
    points = sample_surface(wide, 40_000)
    low = points[points[:, 2] == 0]
    assert len(low) / len(points) == pytest.approx(0.75, abs=0.01)  # areas 1.5 and 0.5
    np.testing.assert_allclose(low.mean(axis=0), [1, 1 / 3, 0], atol=0.02)


def test_points_on_the_surface_score_as_their_spacing() -> None:
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101)), axis=-1)
    points = np.concatenate([grid.reshape(-1, 2), np.zeros((101**2, 1))], axis=1)
    score = surface_score(points, square(), threshold=0.01)
    assert score.accuracy == pytest.approx(0, abs=1e-7)
    assert score.completeness == pytest.approx(0.00383, rel=0.02)  # 0.3826 of the spacing
    assert score.chamfer == pytest.approx(score.completeness / 2, rel=1e-4)
    assert score.recall == score.f_score == 1.0


def test_a_missing_half_and_a_cloud_of_strays_show_in_recall_and_precision() -> None:
    random = np.random.default_rng(1)
    half = np.column_stack([random.uniform(0, [0.5, 1], size=(4000, 2)), np.zeros(4000)])
    strays = half[:1000] + [0, 0, 0.3]
    score = surface_score(np.concatenate([half, strays]), square(), threshold=0.03)
    assert score.f_score == pytest.approx(1 / (0.5 / 0.8 + 0.5 / score.recall))
    assert score.recall == pytest.approx(0.53, abs=0.01)  # the half and a strip of the threshold
    assert score.accuracy == pytest.approx(0.06, rel=1e-3)


def test_nothing_to_compare_is_an_error() -> None:
    nothing, one = np.zeros((0, 3)), np.zeros((1, 3))
    for points, mesh, threshold, message in (
        (nothing, square(), 0.1, "0 points"),
        (one, TriangleMesh(nothing, nothing, nothing), 0.1, "0 tri"),
        (one, square(0.0), 0.1, "no area"),
        (one, square(), 0.0, "threshold"),
    ):
        with pytest.raises(DigsError, match=message):
            surface_score(points, mesh, threshold)


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
