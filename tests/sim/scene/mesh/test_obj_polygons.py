"""Polygons of OBJ files keep their notches."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.scene.load import load_scene
from digs_warp.sim.scene.mesh.obj_polygons import cut_polygons
from reference.mesh_files import face_vectors

# An L, counterclockwise in the plane z = 0; its corners come one after the other.
CORNERS = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], float)
AREA = 5.0


def obj(corners: np.ndarray, faces: str) -> bytes:
    rows = "".join(f"v {' '.join(map(str, row))}\n" for row in corners)
    return f"{rows}{faces}\n".encode()


def turned(by: np.ndarray) -> np.ndarray:
    """The corners in another plane of space."""
    return np.c_[CORNERS, np.zeros(len(CORNERS))] @ by.T


@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_polygon_with_a_notch_keeps_its_area(
    tmp_path: Path, first: int, clockwise: bool, axis: int
) -> None:
    corners = np.roll(turned(np.roll(np.eye(3), axis, axis=0)), -first, axis=0)
    if clockwise:
        corners = corners[::-1]
    (tmp_path / "l.obj").write_bytes(obj(corners, "f 1 2 3 4 5 6"))
    scene = load_scene(tmp_path / "l.obj", unit="m", up="y")
    vectors = face_vectors(scene)
    assert np.linalg.norm(vectors, axis=1).sum() / 2 == pytest.approx(AREA)
    # All triangles face the way of the polygon.
    np.testing.assert_allclose(np.linalg.norm(vectors.sum(axis=0)) / 2, AREA)


def test_corners_keep_their_texture_and_negative_numbers_count_back() -> None:
    text = cut_polygons(obj(turned(np.eye(3)), "f -6/1 -5/2 -4/3 -3/4 -2/5 -1/6\nf 1 2 3"))
    assert text is not None
    faces = [line.split()[1:] for line in text.decode().splitlines() if line.startswith("f")]
    assert faces[-1] == ["1", "2", "3"] and [len(face) for face in faces] == [3] * 5
    pairs = {corner for face in faces[:-1] for corner in face}
    assert pairs == {f"{number - 7}/{number}" for number in range(1, 7)}


def test_convex_polygons_and_quadrilaterals_stay() -> None:
    angles = np.linspace(0, 2 * np.pi, 7)[:-1]
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    assert cut_polygons(obj(ring, "f 1 2 3 4 5 6")) is None
    assert cut_polygons(obj(ring, "f 1 2 3 4")) is None


def test_a_polygon_without_area_ends() -> None:
    line = np.stack([[0.0, 1, 2, 1, 3, 0.5], np.zeros(6), np.zeros(6)], axis=1)
    text = cut_polygons(obj(line, "f 1 2 3 4 5 6"))
    assert text is None or text.count(b"\nf ") == 4
