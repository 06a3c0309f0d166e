"""What the header of a mesh file promises, against what the file holds: checked before memory is taken."""

import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from digs_warp.bounds import FREE_UNPACKED, TRIANGLES
from digs_warp.checks import DigsError, MeshError
from digs_warp.data.ply_table import ASCII, PlyElement, PlyHeader, read_ply_header
from digs_warp.sim.scene.mesh.gltf import COMPONENTS, TYPES

# Views of the same bytes: attributes that lie between each other, or that several meshes share.
_MOST_VIEWS = 8
# Nodes may show a mesh many times; each time it takes memory. The wheels of a train do not reach this.
_MOST_COPIES, _FREE_TRIANGLES = 16, 1 << 20
# A binary STL file: a header of 80 bytes, a count, 50 bytes per triangle.
_STL_COUNT = struct.Struct("<80xI")
_STL_TRIANGLE_BYTES = 50
_STL_NO_COUNT = 0xFFFFFFFF
# In text, the word "facet" is in the second line.
_STL_LOOKED_AT = 1024


def check_promises(path: Path, header: dict[str, Any]) -> None:
    """Check the counts of a mesh file.

    Args:
        path: of a known format.
        header: of glTF; else empty.

    Raises:
        MeshError: more triangles than `digs_warp.bounds.TRIANGLES`, or more data than the file holds.
    """
    where = f"mesh '{path}'"
    suffix = path.suffix.lower()
    try:
        if suffix == ".ply":
            _check_ply(path, where)
        elif suffix == ".stl":
            _check_stl(path, where)
        elif header:
            _check_gltf(path, header, where)
    except DigsError as error:
        raise MeshError(str(error)) from None
    except (AttributeError, IndexError, KeyError, TypeError, OverflowError) as error:
        raise MeshError(
            f"{where}: its header is broken ({error!r}); copy or export the file again"
        ) from error


def _check_ply(path: Path, where: str) -> None:
    header = read_ply_header(path)
    for element in header.elements:
        if element.name == "face":
            TRIANGLES.check(where, element.count)
    least = sum(element.count * _least_bytes(element, header) for element in header.elements)
    held = path.stat().st_size - header.data_start
    if least > held + 1:  # the last line of a text may lack its end
        raise MeshError(
            f"{where}: its header promises at least {least:,} bytes, the file holds {held:,}; truncated or "
            "damaged, copy or export it again"
        )


def _least_bytes(element: PlyElement, header: PlyHeader) -> int:
    """Return the fewest bytes that a row can have: in text a digit and a blank for each column."""
    if header.encoding == ASCII:
        return 2 * len(element.columns)
    return sum(int(kind.split()[0][1:]) for kind in element.columns.values())


def _check_stl(path: Path, where: str) -> None:
    with path.open("rb") as file:
        count = _stl_triangles(file.read(_STL_LOOKED_AT), path.stat().st_size)
    held = (path.stat().st_size - _STL_COUNT.size) // _STL_TRIANGLE_BYTES
    if count is not None and count > held:
        raise MeshError(
            f"{where}: its header promises {count:,} triangles, the file holds {held:,}; truncated "
            "or damaged, copy or export it again"
        )
    TRIANGLES.check(where, count or 0)


def _stl_triangles(start: bytes, size: int) -> int | None:
    """Return the triangles of a binary STL file of ``size`` bytes, by its start; None: it is text."""
    if len(start) < _STL_COUNT.size:
        return None
    count, held = _STL_COUNT.unpack_from(start)[0], (size - _STL_COUNT.size) // _STL_TRIANGLE_BYTES
    if count > held and b"facet" in start.lower():
        return None
    # Programs that write to a pipe cannot go back to fill it in.
    return held if count in (0, _STL_NO_COUNT) else count


def plain_stl(data: bytes) -> bytes:
    """Return an STL file without what follows its triangles, for which trimesh would take it for text."""
    count = _stl_triangles(data[:_STL_LOOKED_AT], len(data))
    if count is None:
        return data.replace(b"\r", b"\n")  # which end the lines of old programs
    end = _STL_COUNT.size + count * _STL_TRIANGLE_BYTES
    return data[:80] + count.to_bytes(4, "little") + data[_STL_COUNT.size : end]


def _check_gltf(path: Path, header: dict[str, Any], where: str) -> None:
    accessors = header.get("accessors", [])
    views = header.get("bufferViews", [])
    lengths = [_element_bytes(each) * sum(_counts(each)) for each in accessors]
    unfounded = sum(
        length for each, length in zip(accessors, lengths, strict=True) if "bufferView" not in each
    )
    if unfounded > FREE_UNPACKED:
        raise MeshError(
            f"{where}: its accessors promise {unfounded:,} bytes of zeros without data, expected up to "
            f"{FREE_UNPACKED:,}; export it again"
        )
    held = _buffer_bytes(path, header)
    for each in accessors:
        length = _element_bytes(each) * _counts(each)[0]
        if "bufferView" in each and length > (size := views[each["bufferView"]]["byteLength"]):
            raise MeshError(
                f"{where}: an accessor promises {length:,} bytes, its view has {size:,}; "
                "truncated or damaged, copy or export it again"
            )
    most = FREE_UNPACKED + _MOST_VIEWS * held
    promised = sum(lengths) + sum(each["byteLength"] for each in views)
    if promised > most:
        raise MeshError(
            f"{where}: its accessors and views promise {promised:,} bytes, expected up to {most:,} of "
            f"buffers with {held:,}; truncated or damaged, copy or export it again"
        )
    of_mesh = [_triangles(mesh, accessors) for mesh in header.get("meshes", [])]
    shown = sum(of_mesh[node["mesh"]] for node in header.get("nodes", []) if "mesh" in node)
    TRIANGLES.check(where, shown)
    most = _FREE_TRIANGLES + _MOST_COPIES * sum(of_mesh)
    if shown > most:
        raise MeshError(
            f"{where}: its nodes show {shown:,} triangles, expected up to {most:,} of meshes with "
            f"{sum(of_mesh):,}; export only the object to record"
        )


def _element_bytes(accessor: dict[str, Any]) -> int:
    return int(TYPES[accessor["componentType"]][-1]) * COMPONENTS[accessor["type"]]


def _counts(accessor: dict[str, Any]) -> list[int]:
    """Return the elements of an accessor, and how many of them a sparse one replaces."""
    counts = [accessor["count"], accessor.get("sparse", {}).get("count", 0)]
    if not all(isinstance(count, int) and count >= 0 for count in counts):
        raise TypeError(f"{counts} elements")
    return counts


def _buffer_bytes(path: Path, header: dict[str, Any]) -> int:
    """Return the length of all buffers, as the files have it, not as the header claims."""
    total = 0
    for buffer in header.get("buffers", []):
        uri = buffer.get("uri")
        if uri is None:
            total += path.stat().st_size
        elif uri.startswith("data:"):
            total += len(uri)
        else:
            total += (path.parent / unquote(uri)).stat().st_size
    return total


def _triangles(mesh: dict[str, Any], accessors: list[dict[str, Any]]) -> int:
    counts = (
        primitive.get("indices", primitive["attributes"].get("POSITION"))
        for primitive in mesh["primitives"]
    )
    return sum(accessors[each]["count"] // 3 for each in counts if each is not None)
