"""Parts of OBJ files and materials of MTL files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.images import linear_from_srgb
from digs_warp.data.point_cloud import unit_colors
from digs_warp.sim.scene.mesh.files_beside import FilesBeside, obj_materials, text_of, without_mark
from digs_warp.sim.scene.mesh.materials import (
    MIN_OPACITY,
    PLAIN_COLOR,
    PLAIN_ROUGHNESS,
    alpha_pixels,
    color_texture,
    rgb_pixels,
)
from digs_warp.sim.scene.mesh.normals import unique_rows
from digs_warp.sim.scene.mesh.parts import MeshPart, mesh_part
from digs_warp.sim.scene.mesh.polygons import triangulated
from digs_warp.sim.scene.scene import Material


def obj_parts(path: Path, files: FilesBeside) -> list[MeshPart]:
    """Return the triangles of an OBJ file, a part for each material; that is an entry of the MTL file.

    Raises:
        ValueError, IndexError: a line is not as the format says.
    """
    rows: dict[bytes, list[list[bytes]]] = {b"v": [], b"vt": [], b"vn": []}
    corners, sizes, counts, owners = (
        list[bytes](),
        list[int](),
        list[tuple[int, ...]](),
        list[int](),
    )
    names, current = [b""], 0
    text = without_mark(path.read_bytes()).replace(b"\r\n", b"\n")
    for line in text.replace(b"\\\n", b" ").splitlines():
        key, *words = line.split() or [b""]
        if key in rows:
            rows[key].append(words)
        elif key == b"f":
            words = line.partition(b"#")[0].split()[1:]
            corners += words
            sizes.append(len(words))
            counts.append(tuple(map(len, rows.values())))
            owners.append(current)
        elif key == b"usemtl":
            name = b" ".join(words)
            names += [] if name in names else [name]
            current = names.index(name)
    if not sizes:
        return []
    points = _table(rows[b"v"], 3)
    colored = all(len(each) >= 6 for each in rows[b"v"])
    colors = _table([each[3:] for each in rows[b"v"]], 3) if colored else None
    uvs, normals = _table(rows[b"vt"], 2), _table(rows[b"vn"], 3)
    numbers = _numbers(corners, np.repeat(counts, sizes, axis=0))
    places, polygons = triangulated(np.array(sizes), numbers[:, 0], points)
    materials = _materials(path, files)
    # Corners of the same place, texture and normal are one vertex.
    first, vertex_of = unique_rows([*numbers.T])
    parts = []
    for number in np.unique(np.array(owners)[polygons]):
        own = places[np.array(owners)[polygons] == number]
        used, faces = np.unique(vertex_of[own], return_inverse=True)
        at, uv_at, normal_at = numbers[first[used]].T
        parts.append(
            mesh_part(
                points[at],
                faces.reshape(-1, 3),
                np.where(
                    normal_at[:, None] < 0, np.nan, np.append(normals, [[0] * 3], 0)[normal_at]
                ),
                uvs[uv_at] if (uv_at >= 0).all() else None,
                None if colors is None else linear_from_srgb(unit_colors(colors[at])),
                materials.get(text_of(names[number])),
            )
        )
    return parts


def _table(rows: list[list[bytes]], width: int) -> np.ndarray:
    """Return the first numbers of each row, (n, width), float64."""
    return np.array([row[:width] for row in rows], np.float64).reshape(-1, width)


def _numbers(corners: list[bytes], counts: np.ndarray) -> np.ndarray:
    """Return what corners such as 3/7/2 name, from 0, (n, 3); -1: nothing.

    Args:
        corners: of all faces; negative numbers count back from the last one so far.
        counts: of vertices, texture coordinates and normals when each came, (n, 3).
    """
    words = [(corner + b"//").split(b"/")[:3] for corner in corners]
    numbers = np.array([[int(word or 0) for word in each] for each in words])
    numbers = np.where(numbers < 0, counts + numbers, numbers - 1)
    highest = counts.max(axis=0)
    if not ((numbers[:, 0] >= 0) & (numbers[:, 0] < highest[0])).all():
        raise ValueError(f"a face names a vertex that is not there; the file has {highest[0]}")
    return np.where(numbers < highest, numbers, -1)


def _materials(path: Path, files: FilesBeside) -> dict[str, dict[str, str]]:
    """Return the entries of all material files by name, each a mapping of its lines."""
    found: dict[str, dict[str, str]] = {}
    for name in obj_materials(path):
        entry: dict[str, str] = {}
        for line in files.text(name).splitlines():
            key, _, value = text_of(line).strip().replace("\t", " ").partition(" ")
            if key == "newmtl":
                label = " ".join(value.split())
                entry = found.setdefault(label, {"newmtl": label})
            else:
                entry[key.lower()] = value.strip()
    return found


def mtl_material(files: FilesBeside, entry: Any, parts: Sequence[MeshPart]) -> Material:
    """Convert a material of an MTL file, or the texture of a PLY file: colors are sRGB, as in most programs.

    With a texture the diffuse color is ignored: exporters write any color there, even black.
    """
    if isinstance(entry, str):
        entry = {"newmtl": "texture", "map_kd": entry}
    name = entry["newmtl"]
    image = files.image(entry.get("map_kd"))
    texture = color_texture(image, name, parts)
    base_color, roughness = np.ones(3), PLAIN_ROUGHNESS
    kd = entry.get("kd", "").split()  # a single number is that of all channels
    if texture is None and kd:
        base_color = linear_from_srgb(np.array((kd + 2 * kd[:1])[:3], np.float64).clip(0, 1))
    elif texture is None and not parts[0].colored:
        base_color = np.array(PLAIN_COLOR)
    if "ns" in entry:
        # Blinn-Phong exponent to GGX width, alpha^2 = 2 / (exponent + 2); roughness is the root of alpha.
        roughness = (2.0 / (max(float(entry["ns"]), 0.0) + 2.0)) ** 0.25
    return Material(
        name,
        base_color.astype(np.float32),
        texture,
        roughness,
        **_opacity(entry, name, image, files.image(entry.get("map_d")), parts),
    )


def _opacity(
    entry: Mapping[str, str], name: str, image: Any, opacity_map: Any, parts: Sequence[MeshPart]
) -> dict[str, Any]:
    """Return opacity from ``d`` or ``Tr`` and from ``map_d`` or the alpha of the texture."""
    try:
        transparency = 1.0 - float(entry.get("tr", "0").split()[-1])
        opacity = float(np.clip(float(entry.get("d", str(transparency)).split()[-1]), 0.0, 1.0))
    except ValueError:
        opacity = 1.0
    alpha, source = None, image if opacity_map is None else opacity_map
    if source is not None and parts[0].uvs is not None:
        alpha = alpha_pixels(source, name)
        if alpha is None and opacity_map is not None:
            alpha = rgb_pixels(opacity_map, name)[..., 0]  # a map in gray
    if alpha is None:
        return {"opacity": opacity}
    return {
        "opacity": opacity * float(alpha.mean()) / 255.0,
        "opacity_texture": np.rint(alpha * opacity).astype(np.uint8),
        "alpha_cutoff": MIN_OPACITY,
    }
