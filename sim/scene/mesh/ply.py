"""Parts of PLY and STL files."""

import struct
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError, MeshError
from digs_warp.data.images import linear_from_srgb
from digs_warp.data.ply_table import BYTE_ORDERS, PlyElement, PlyHeader, read_ply_header
from digs_warp.data.point_cloud import COLOR, unit_colors
from digs_warp.sim.scene.mesh.files_beside import ply_textures, without_mark
from digs_warp.sim.scene.mesh.parts import MeshPart, mesh_part
from digs_warp.sim.scene.mesh.polygons import strip_triangles, triangulated

_CORNERS = ("vertex_indices", "vertex_index")
# What programs call the texture coordinates of vertices.
_UVS = (("texture_u", "texture_v"), ("u", "v"), ("s", "t"))

# A binary STL file: a header of 80 bytes, a count, 50 bytes per triangle.
_STL_HEADER = struct.Struct("<80xI")
_STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("_", "<u2")])
_STL_NO_COUNT = (0, 0xFFFFFFFF)  # programs that write to a pipe cannot go back to fill it in


def ply_parts(path: Path) -> list[MeshPart]:
    """Return the triangles of a PLY file as one part; its material is the name of a texture, or None.

    Raises:
        DigsError: no PLY file, or truncated.
        ValueError, KeyError, IndexError: the data is not as the header says.
    """
    tables = _read_rows(path, read_ply_header(path))
    table, faces = tables["vertex"], tables.get("face", {})
    points = _columns(table, "xyz")
    strips = [strip_triangles(np.asarray(each)) for each in _lists(tables.get("tristrips", {}))]
    polygons = _lists(faces)
    sizes = np.array([len(each) for each in polygons], np.int64)
    corners = _flat(polygons).astype(np.int64)
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        raise ValueError(f"a face names vertex {corners.max()}, the file has {len(points)}")
    places, owners = triangulated(sizes, corners, points)
    triangles = corners[places]
    if strips and not len(triangles):
        triangles = np.concatenate(strips)
    if not len(triangles):
        return []
    normals = np.full(points.shape, np.nan)
    if {"nx", "ny", "nz"} <= table.keys():
        normals = _columns(table, ("nx", "ny", "nz"))
    uvs = next((_columns(table, names) for names in _UVS if {*names} <= table.keys()), None)
    colors = _colors(table)
    of_faces = None if colors is not None or not len(places) else _colors(faces)
    of_corners = _flat(faces.get("texcoord", [])).reshape(-1, 2)
    has_own_uvs = len(corners) == len(of_corners) > 0
    if has_own_uvs or of_faces is not None:
        # Corners with values of their own.
        used = triangles.reshape(-1)
        points, normals = points[used], normals[used]
        uvs = None if uvs is None else uvs[used]
        colors = None if colors is None else colors[used]
        if of_faces is not None:
            colors = np.repeat(of_faces[owners], 3, axis=0)
        if has_own_uvs:
            uvs = of_corners[places.reshape(-1)].astype(np.float64)
        triangles = np.arange(len(used)).reshape(-1, 3)
    texture = next(iter(ply_textures(path)[-1:]), None)
    return [mesh_part(points, triangles, normals, uvs, colors, texture)]


def _lists(table: dict[str, Any]) -> Any:
    return next((table[name] for name in _CORNERS if name in table), [])


def _flat(lists: Any) -> np.ndarray:
    """Return the items of all lists, one after the other."""
    return lists.reshape(-1) if isinstance(lists, np.ndarray) else np.concatenate([[], *lists])


def _columns(table: dict[str, Any], names: Any) -> np.ndarray:
    return np.stack([table[name] for name in names], axis=1).astype(np.float64)


def _colors(table: dict[str, Any]) -> np.ndarray | None:
    """Return linear colors, (n, 3); None: there are none."""
    if not set(COLOR) <= table.keys():
        return None
    return linear_from_srgb(unit_colors(np.stack([table[name] for name in COLOR], axis=1)))


def _read_rows(path: Path, header: PlyHeader) -> dict[str, dict[str, Any]]:
    """Return all columns by element and name: arrays, shape (n,); of lists, one array for each row.

    Raises:
        DigsError: the file holds fewer numbers than its header promises.
    """
    data = path.read_bytes()[header.data_start :]
    order = BYTE_ORDERS.get(header.encoding)
    rows = _TextRows(data) if order is None else _BinaryRows(data, order)
    try:
        return {element.name: rows.table(element) for element in header.elements}
    except EOFError:
        raise DigsError(
            f"PLY '{path}': ends before the last of the rows that its header promises; truncated or damaged, "
            "copy or export it again"
        ) from None


class _TextRows:
    """Rows of a text file, a line for each. Some programs write more into a line than the header says."""

    def __init__(self, data: bytes) -> None:
        self._lines = data.splitlines()

    def table(self, element: PlyElement) -> dict[str, Any]:
        """Return the columns of the next element; raise an `EOFError` where numbers are missing."""
        lines, self._lines = self._lines[: element.count], self._lines[element.count :]
        if element.columns and len(lines) < element.count:
            raise EOFError
        columns: dict[str, Any] = {name: [] for name in element.columns}
        kinds = [each.split() for each in element.columns.values()]
        for line in lines:
            words = line.split()
            for values, kind in zip(columns.values(), kinds, strict=True):
                first = _numbers(words[:1], kind[0], 1)[0]
                del words[:1]
                if len(kind) == 1:
                    values.append(first)
                    continue
                values.append(_numbers(words[: int(first)], kind[1], int(first)))
                del words[: int(first)]
        return _joined(element, columns)


def _numbers(words: list[bytes], kind: str, count: int) -> np.ndarray:
    if len(words) < count:
        raise EOFError
    return np.array(words, np.float64).astype(kind)


class _BinaryRows:
    """Rows of a binary file."""

    def __init__(self, data: bytes, order: str) -> None:
        self._data, self._order, self._at = data, order, 0

    def table(self, element: PlyElement) -> dict[str, Any]:
        """Return the columns of the next element; raise an `EOFError` where numbers are missing."""
        columns: dict[str, Any] = {name: [] for name in element.columns}
        if not columns or not element.count:
            return _joined(element, columns)
        start = self._at
        even = self._even_table(element)
        if even is not None:
            return even
        self._at = start
        kinds = [[self._order + kind for kind in each.split()] for each in element.columns.values()]
        for _ in range(element.count):
            for values, (kind, *items) in zip(columns.values(), kinds, strict=True):
                first = self._take(kind, 1)[0]
                values.append(self._take(items[0], int(first)) if items else first)
        return _joined(element, columns)

    def _even_table(self, element: PlyElement) -> dict[str, Any] | None:
        """Return the columns if all lists are as long as those of the first row; else None."""
        start, fields, lengths = self._at, [], {}
        for name, each in element.columns.items():
            *length, kind = (self._order + kind for kind in each.split())
            if length:
                lengths[name] = int(self._take(length[0], 1)[0])
                fields.append((f"number of {name}", length[0]))
            self._take(kind, lengths.get(name, 1))
            fields.append((name, kind, (lengths[name],)) if length else (name, kind))
        self._at = start
        if element.count * np.dtype(fields).itemsize > len(self._data) - start:
            return None
        rows = self._take(np.dtype(fields), element.count)
        if all((rows[f"number of {name}"] == length).all() for name, length in lengths.items()):
            return {name: rows[name] for name in element.columns}
        return None

    def _take(self, kind: Any, count: int) -> np.ndarray:
        if count > (len(self._data) - self._at) // np.dtype(kind).itemsize:
            raise EOFError
        values = np.frombuffer(self._data, kind, count, self._at)
        self._at += values.nbytes
        return values


def _joined(element: PlyElement, columns: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers of each column as an array; lists stay lists of arrays."""
    return {
        name: values if " " in (kind := element.columns[name]) else np.array(values, kind)
        for name, values in columns.items()
    }


def stl_parts(path: Path) -> list[MeshPart]:
    """Return the triangles of an STL file, binary or text, as one part; what follows them is left out.

    Raises:
        MeshError: fewer triangles than its header promises.
        ValueError: a text with other words.
    """
    data = without_mark(path.read_bytes())
    held = (len(data) - _STL_HEADER.size) // _STL_TRIANGLE.itemsize
    count = _STL_HEADER.unpack_from(data)[0] if held >= 0 else 0
    if held < 0 or (count > held and b"facet" in data[:1024].lower()):
        words = data.lower().split()
        numbers = [words[i + 1 : i + 4] for i, word in enumerate(words) if word == b"vertex"]
        corners = np.array(numbers, np.float64).reshape(-1, 3, 3)
    else:
        count = held if count in _STL_NO_COUNT else count
        if count > held:
            raise MeshError(
                f"mesh '{path}': its header promises {count:,} triangles, the file holds {held:,}; truncated "
                "or damaged, copy or export it again"
            )
        corners = np.frombuffer(data, _STL_TRIANGLE, count, _STL_HEADER.size)["corners"]
    points = corners.reshape(-1, 3).astype(np.float64)
    faces = np.arange(len(points)).reshape(-1, 3)
    nothing = np.full(points.shape, np.nan)
    return [mesh_part(points, faces, nothing, None, None, None)] if len(faces) else []
