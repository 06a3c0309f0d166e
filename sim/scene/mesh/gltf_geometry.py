"""The triangles that the scene of a glTF file shows: nodes, skins, and primitives of any layout."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.point_cloud import unit_colors
from digs_warp.sim.scene.mesh.gltf import GltfNumbers, parent_from_node
from digs_warp.sim.scene.mesh.gltf_materials import placed_uvs
from digs_warp.sim.scene.mesh.parts import MeshPart, mesh_part
from digs_warp.sim.scene.mesh.polygons import strip_triangles

# Modes of primitives; others are points and lines.
TRIANGLES, STRIP, FAN = 4, 5, 6


def gltf_parts(path: Path, header: dict[str, Any]) -> list[MeshPart]:
    """Return every primitive with triangles, once per node that shows it.

    Args:
        path: a .gltf or .glb file.
        header: of the file, checked.
    """
    numbers, nodes = GltfNumbers(path, header), header.get("nodes", [])
    placed = _world_from_node(nodes)
    parts = []
    for number in _shown(nodes, header["scenes"][header.get("scene", 0)].get("nodes", [])):
        node = nodes[number]
        if "mesh" not in node:
            continue
        joints = _joints(header["skins"][node["skin"]], placed, numbers) if "skin" in node else None
        for primitive in header["meshes"][node["mesh"]]["primitives"]:
            part = _part(header, primitive, numbers, placed[number], joints)
            parts += [] if part is None else [part]
    return parts


def _part(
    header: dict[str, Any],
    primitive: dict[str, Any],
    numbers: GltfNumbers,
    world_from_node: np.ndarray,
    joints: np.ndarray | None,
) -> MeshPart | None:
    """Return a primitive; None if it has no triangles."""
    attributes, mode = primitive["attributes"], primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN):
        return None
    vertices = numbers.values(attributes["POSITION"]).astype(np.float64)
    corners = np.arange(len(vertices))
    if "indices" in primitive:
        corners = numbers.values(primitive["indices"])[:, 0].astype(np.int64)
    normals = np.full(vertices.shape, np.nan)
    if "NORMAL" in attributes:
        normals = numbers.values(attributes["NORMAL"]).astype(np.float64)
    if joints is not None and "JOINTS_0" in attributes:
        # The node of the mesh itself means nothing.
        world_from_node = np.eye(4)
        vertices, normals = _held_by_joints(attributes, numbers, joints, vertices, normals)
    faces, colors = _faces(corners, mode), None
    if "COLOR_0" in attributes:
        colors = unit_colors(numbers.values(attributes["COLOR_0"])[:, :3])
    uvs = material = None
    if "material" in primitive:
        material = header["materials"][primitive["material"]]
        uvs = placed_uvs(material, attributes, numbers)
    if not len(faces):
        return None
    return mesh_part(vertices, faces, normals, uvs, colors, material, world_from_node)


def _faces(corners: np.ndarray, mode: int) -> np.ndarray:
    """Return the triangles, (m, 3), that corners in their order make."""
    if mode == STRIP:
        return strip_triangles(corners)
    if mode == FAN:  # they share their first corner
        first = np.full(max(len(corners) - 2, 0), corners[0])
        return np.stack([first, corners[1:-1], corners[2:]], axis=1)
    return corners.reshape(-1, 3)


def _joints(
    skin: dict[str, Any], placed: dict[int, np.ndarray], numbers: GltfNumbers
) -> np.ndarray:
    """Return where each joint of a skin takes a vertex, (joints, 4, 4)."""
    joints = np.stack([placed[joint] for joint in skin["joints"]])
    if "inverseBindMatrices" in skin:
        stored = numbers.values(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
        joints = joints @ stored[: len(joints)].swapaxes(1, 2)  # stored by columns
    return joints


def _held_by_joints(
    attributes: dict[str, int],
    numbers: GltfNumbers,
    world_from_bind: np.ndarray,
    vertices: np.ndarray,
    normals: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and normals where the joints of a skin hold them."""
    sets = [name[len("JOINTS_") :] for name in attributes if name.startswith("JOINTS_")]
    joints = np.concatenate([numbers.values(attributes[f"JOINTS_{each}"]) for each in sets], 1)
    weights = np.concatenate([numbers.values(attributes[f"WEIGHTS_{each}"]) for each in sets], 1)
    weights = weights.astype(np.float64)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), np.finfo(np.float32).tiny)
    moved, turned = np.zeros_like(vertices), np.zeros_like(normals)
    for joint, weight in zip(joints.T, weights.T, strict=True):
        matrices = world_from_bind[joint]
        linear, shift = matrices[:, :3, :3], matrices[:, :3, 3]
        moved += weight[:, None] * (np.einsum("nij,nj->ni", linear, vertices) + shift)
        turned += weight[:, None] * np.einsum("nij,nj->ni", linear, normals)
    return moved, turned


def _world_from_node(nodes: list[dict[str, Any]]) -> dict[int, np.ndarray]:
    """Return the placement of every node, (4, 4), by its number."""
    parents = {
        child: number for number, node in enumerate(nodes) for child in node.get("children", [])
    }
    placed: dict[int, np.ndarray] = {}
    for number in range(len(nodes)):
        chain: dict[int, None] = {}  # up to the first node that is placed, or is its own ancestor
        while number >= 0 and number not in placed and number not in chain:
            chain[number] = None
            number = parents.get(number, -1)
        for each in reversed(chain):
            above = placed.get(parents.get(each, -1), np.eye(4))
            placed[each] = above @ parent_from_node(nodes[each])
    return placed


def _shown(nodes: list[dict[str, Any]], roots: list[int]) -> Iterator[int]:
    """Yield the nodes that a scene with these roots shows, each once."""
    seen, waiting = set[int](), list(roots)
    while waiting:
        number = waiting.pop()
        if number not in seen:
            seen.add(number)
            waiting += nodes[number].get("children", [])
            yield number
