"""Polygons of OBJ and PLY files keep their notches; strips and old names of PLY are read."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.sim.scene.load import load_scene
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
def test_a_polygon_with_a_notch_keeps_its_area(tmp_path: Path, first: int, clockwise: bool) -> None:
    corners = np.roll(turned(np.roll(np.eye(3), first, axis=0)), -first, axis=0)
    if clockwise:
        corners = corners[::-1]
    (tmp_path / "l.obj").write_bytes(obj(corners, "f 1 2 3 4 5 6"))
    scene = load_scene(tmp_path / "l.obj", unit="m", up="y")
    vectors = face_vectors(scene)
    assert np.linalg.norm(vectors, axis=1).sum() / 2 == pytest.approx(AREA)
    # All triangles face the way of the polygon.
    np.testing.assert_allclose(np.linalg.norm(vectors.sum(axis=0)) / 2, AREA)


def test_corners_keep_their_texture_and_negative_numbers_count_back(tmp_path: Path) -> None:
    uvs = "".join(f"vt {x / 4} {y / 4}\n" for x, y in CORNERS)
    # A line of Windows goes on after a backslash.
    text = obj(turned(np.eye(3)), f"{uvs}f -6/1 -5/2 -4/3 \\\r\n-3/4 -2/5 -1/6\nv 0 0 9")
    (tmp_path / "l.obj").write_bytes(text)
    scene = load_scene(tmp_path / "l.obj", unit="m", up="z")
    low = scene.vertices.min(axis=0)[:2]
    np.testing.assert_allclose((scene.vertices[:, :2] - low) / 4, scene.uvs, atol=1e-6)
    assert len(scene.faces) == 4 and len(scene.vertices) == 6


def ply(folder: Path, order: str, tables: dict[str, tuple[list[str], list[list[Any]]]]) -> Path:
    """Write a PLY file: by element, its properties and its rows; lists begin with their length."""
    forms = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}
    kinds = {"float": "f4", "uchar": "u1", "ushort": "u2", "int": "i4"}
    header, data = [f"ply\nformat {forms[order]} 1.0"], b""
    for name, (properties, rows) in tables.items():
        header += [f"element {name} {len(rows)}", *(f"property {each}" for each in properties)]
        for row in rows:
            if not order:
                flat = [v for value in row for v in np.atleast_1d(value)]
                data += " ".join(map(str, flat)).encode() + b"\n"
                continue
            for each, value in zip(properties, row, strict=True):
                *_, length, kind, _ = ["", *each.split()]
                if each.startswith("list"):
                    data += np.array(value[0], order + kinds[length]).tobytes()
                    value = value[1:]
                data += np.array(value, order + kinds[kind]).tobytes()
    path = folder / "m.ply"
    path.write_bytes("\n".join([*header, "end_header\n"]).encode() + data)
    return path


POINTS = [[*corner, 0.0] for corner in CORNERS.tolist()]
XYZ = ["float x", "float y", "float z"]
CORNER_LIST = ["list uchar int vertex_indices"]
STRIP = [0, 1, 3, 2]


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("others", [[], [[[3, 0, 1, 2]], [[4, 0, 1, 2, 3]]]])
def test_faces_of_ply_may_have_any_number_of_corners(
    tmp_path: Path, order: str, others: list[Any]
) -> None:
    faces = [[[6, 2, 3, 4, 5, 0, 1]], *others]
    path = ply(tmp_path, order, {"vertex": (XYZ, POINTS), "face": (CORNER_LIST, faces)})
    areas = np.linalg.norm(face_vectors(load_scene(path, unit="m", up="z")), axis=1) / 2
    assert areas.sum() == pytest.approx(AREA + (4.0 if others else 0.0))


def test_a_line_of_ply_may_hold_more_than_the_header_says(tmp_path: Path) -> None:
    path = ply(tmp_path, "", {"vertex": (XYZ, POINTS), "face": (CORNER_LIST, [[[3, 0, 1, 2]]] * 2)})
    path.write_bytes(path.read_bytes().replace(b"\n3 0 1 2", b"\n3 0 1 2 9 1 1 1"))
    assert len(load_scene(path, unit="m", up="z").faces) == 2


@pytest.mark.parametrize(
    ("order", "kind", "names", "top"),
    [
        ("", "uchar", "diffuse_red diffuse_green diffuse_blue", 255),
        ("<", "uchar", "red green blue", 255),
        (">", "ushort", "red green blue", 65535),
        ("", "float", "r g b", 1.0),
        ("<", "float", "Red Green Blue", 255.0),
    ],
)
def test_strips_and_old_colors_of_ply(
    tmp_path: Path, order: str, kind: str, names: str, top: float
) -> None:
    colors = [f"{kind} {name}" for name in names.split()]
    rows = [[*point, top, 0, top * 128 / 255] for point in POINTS]
    if kind != "float":
        rows = [[*row[:3], *map(round, row[3:])] for row in rows]
    strips = [[[9, *STRIP, -1, 0, 3, 5, 4]]]
    path = ply(
        tmp_path,
        order,
        {
            "vertex": (XYZ + colors, rows),
            "tristrips": (["list int int vertex_indices"], strips),
        },
    )
    scene = load_scene(path, unit="m", up="z")
    vectors = face_vectors(scene)
    assert len(vectors) == 4 and (np.sign(vectors[:, 2]) == np.sign(vectors[0, 2])).all()
    np.testing.assert_allclose(scene.vertex_colors, [[1, 0, 0.2159]] * 6, atol=1e-3)
