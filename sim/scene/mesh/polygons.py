"""Polygons of OBJ and PLY files, and strips of PLY, as triangles.

trimesh draws every polygon as a fan around its first corner, which fills the notches of a letter or of a
window frame. Of PLY it knows neither strips nor, in binary, faces with different numbers of corners.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.images import to_uint8
from digs_warp.data.ply_table import USUAL_NAMES, read_ply_header, read_rows
from digs_warp.data.point_cloud import COLOR, MOST_FLOAT, unit_colors

# Faces with five corners or more. Quadrilaterals with a notch are rare, and there may be millions of others.
_POLYGON = re.compile(rb"^f(?:[ \t]+[^\s\\]+){5,}[ \t]*\r?$", re.MULTILINE)


def cut_polygons(text: bytes) -> bytes | None:
    """Return the text of an OBJ file with triangles for polygons that are not convex; None: it has none.

    Raises:
        ValueError, IndexError: a vertex or a face is not as the format says.
    """
    if _POLYGON.search(text) is None:
        return None
    vertices: list[list[float]] = []
    lines = text.splitlines()
    cut = False
    for number, line in enumerate(lines):
        if line.startswith(b"v "):
            vertices.append([float(word) for word in line.split()[1:4]])
        elif _POLYGON.match(line):
            corners = line.split()[1:]
            numbers = [int(corner.partition(b"/")[0]) for corner in corners]
            # From 1; negative: from the last one so far.
            points = [vertices[each - 1 if each > 0 else each] for each in numbers]
            triangles = _triangles(np.array(points))
            if triangles:
                lines[number] = b"\n".join(_faces(corners, triangles))
                cut = True
    return b"\n".join(lines) + b"\n" if cut else None


def _faces(corners: Sequence[bytes], triangles: Sequence[Sequence[int]]) -> Iterator[bytes]:
    for triangle in triangles:
        yield b" ".join([b"f", *(corners[each] for each in triangle)])


def _triangles(points: np.ndarray) -> list[tuple[int, int, int]]:
    """Return the triangles of a polygon, (n, 3), by cutting off its ears; empty for a convex one."""
    flat = _in_plane(points)
    left = list(range(len(flat)))
    if all(_turn(flat, *_beside(left, at)) >= 0 for at in left):
        return []
    triangles = []
    while len(left) > 3:
        at = next((at for at in range(len(left)) if _is_ear(flat, left, at)), 0)
        triangles.append(_beside(left, at))
        del left[at]
    return [*triangles, (left[0], left[1], left[2])]


def _in_plane(points: np.ndarray) -> np.ndarray:
    """Return the corners in the plane of the polygon, counterclockwise, (n, 2)."""
    moved = points - points[0]
    normal = np.cross(moved, np.roll(moved, -1, axis=0)).sum(axis=0)  # Newell
    axis = int(np.abs(normal).argmax())
    kept = moved[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return kept if normal[axis] >= 0 else kept[:, ::-1]


def _beside(left: Sequence[int], at: int) -> tuple[int, int, int]:
    """Return a corner with those before and after it."""
    return left[at - 1], left[at], left[(at + 1) % len(left)]


def _turn(flat: np.ndarray, a: int, b: int, c: int) -> float:
    """Return twice the area of a triangle, positive if it is counterclockwise."""
    (ux, uy), (vx, vy) = flat[b] - flat[a], flat[c] - flat[a]
    return float(ux * vy - uy * vx)


def _is_ear(flat: np.ndarray, left: Sequence[int], at: int) -> bool:
    """Whether the triangle at a corner lies in the polygon and holds no other corner."""
    a, b, c = _beside(left, at)
    if _turn(flat, a, b, c) <= 0:
        return False
    others = (each for each in left if each not in (a, b, c))
    return not any(
        min(_turn(flat, a, b, p), _turn(flat, b, c, p), _turn(flat, c, a, p)) >= 0 for p in others
    )


_CORNERS = ("vertex_indices", "vertex_index")
# In strips, this number begins a new one.
_NEW_STRIP = -1


def shows_all_of_ply(loaded: Any) -> bool:
    """Whether a `trimesh.Scene` is what a PLY file means: no strips, long polygons or old names of colors."""
    raw = next((each.metadata["_ply_raw"] for each in loaded.geometry.values()), {})
    if "tristrips" in raw:
        return False
    for table in filter(None, (raw.get("vertex"), raw.get("face"))):
        kind = table["properties"].get("red", "u1")
        is_share = "f" in kind and table["length"] and np.max(table["data"]["red"]) <= MOST_FLOAT
        if USUAL_NAMES.keys() & table["properties"] or not ("u1" in kind or is_share):
            return False
    face = raw.get("face", {})
    for name in _CORNERS:
        if name in face.get("properties", {}) and face["length"]:
            rows = face["data"][name]
            rows = rows["f1"] if rows.dtype.names else rows
            most = rows.shape[1] if rows.ndim == 2 else max(map(np.size, rows))
            return most <= 4
    return True


def ply_triangles(path: Path) -> dict[str, dict[str, Any]]:
    """Return the vertices and the faces of a PLY file as trimesh keeps them, all faces triangles.

    Raises:
        ValueError, KeyError, IndexError: the data is not as the header says.
    """
    tables = read_rows(path, read_ply_header(path))
    vertices, faces = tables["vertex"], tables.get("face", {})
    points = np.stack([vertices[axis] for axis in "xyz"], axis=1).astype(np.float64)
    polygons = _corners(faces)
    cuts = [(len(each) > 4 and _triangles(points[each])) or _fan(len(each)) for each in polygons]
    owners = np.repeat(np.arange(len(cuts)), [len(cut) for cut in cuts])
    columns = {name: row[owners] for name, row in faces.items() if isinstance(row, np.ndarray)}
    strips = [strip_triangles(each) for each in _corners(tables.get("tristrips", {}))]
    if strips and not cuts:
        columns["vertex_indices"] = np.concatenate(strips)
    lists = {"vertex_indices": polygons} if cuts else {}
    if "texcoord" in faces:
        lists["texcoord"] = [uvs.reshape(-1, 2) for uvs in faces["texcoord"]]
    for name, rows in lists.items():
        picked = [row[list(each)] for row, cut in zip(rows, cuts, strict=True) for each in cut]
        columns[name] = np.stack(picked).reshape(len(owners), -1)
    for table in (vertices, columns):
        if set(COLOR) <= table.keys():
            rgb = to_uint8(unit_colors(np.stack([table[name] for name in COLOR], axis=1)))
            table |= dict(zip(COLOR, rgb.T, strict=True))
    return {
        name: {"length": len(next(iter(table.values()))), "properties": table, "data": table}
        for name, table in {"vertex": vertices, "face": columns}.items()
    }


def _corners(table: dict[str, Any]) -> list[np.ndarray]:
    return next((table[name] for name in _CORNERS if name in table), [])


def _fan(count: int) -> list[tuple[int, int, int]]:
    return [(0, at, at + 1) for at in range(1, count - 1)]


def strip_triangles(corners: np.ndarray) -> np.ndarray:
    """Return the triangles of strips, (n, 3): every second one is the other way around."""
    pieces = []
    for strip in np.split(corners, np.flatnonzero(corners == _NEW_STRIP)):
        strip = strip[strip != _NEW_STRIP]
        triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
        triangles[1::2] = triangles[1::2, ::-1]
        pieces.append(triangles)
    return np.concatenate(pieces)
