"""Meshes with a skeleton, in the pose of the file.

The vertices of such a mesh follow its joints alone; where its own node stands means nothing (glTF 2.0,
section 3.7.3.3). Read without the joints, it often has a hundredth of its size, or lies on its back.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.sim.scene.mesh.gltf_numbers import GltfNumbers

AddAccessor = Callable[[np.ndarray], int]


def bake_skins(header: dict[str, Any], numbers: GltfNumbers, add: AddAccessor) -> None:
    """Replace every skinned mesh that the scene shows by a still one.

    Args:
        header: of the file; changed in place.
        numbers: of the file.
        add: appends an accessor to the header and returns its number.
    """
    nodes = header.get("nodes", [])
    skinned = [node for node in nodes if "mesh" in node and "skin" in node]
    if not skinned:
        return
    world_from_node = _world_from_node(nodes)
    scene = header["scenes"][header.get("scene", 0)]
    shown = _shown(nodes, scene.get("nodes", []))
    for number, node in enumerate(list(nodes)):
        if "mesh" not in node or "skin" not in node:
            continue
        source, skin = header["meshes"][node.pop("mesh")], header["skins"][node.pop("skin")]
        if number not in shown:
            continue
        joints = np.stack([world_from_node[joint] for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            stored = numbers.values(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
            joints = joints @ stored[: len(joints)].swapaxes(1, 2)  # stored by columns
        primitives = [_still(each, joints, numbers, add) for each in source["primitives"]]
        header["meshes"].append({**source, "primitives": primitives})
        nodes.append({"mesh": len(header["meshes"]) - 1})
        scene["nodes"].append(len(nodes) - 1)


def _still(
    primitive: dict[str, Any], world_from_bind: np.ndarray, numbers: GltfNumbers, add: AddAccessor
) -> dict[str, Any]:
    """Return a primitive whose vertices stand where its joints hold them."""
    attributes = dict(primitive["attributes"])
    sets = [name[len("JOINTS_") :] for name in attributes if name.startswith("JOINTS_")]
    if not sets:
        return primitive
    joints = np.concatenate([numbers.values(attributes[f"JOINTS_{each}"]) for each in sets], 1)
    weights = np.concatenate([numbers.values(attributes[f"WEIGHTS_{each}"]) for each in sets], 1)
    weights = weights.astype(np.float64)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), np.finfo(np.float32).tiny)
    for name, is_point in (("POSITION", True), ("NORMAL", False)):
        if name not in attributes:
            continue
        rows = numbers.values(attributes[name]).astype(np.float64)
        moved = np.zeros_like(rows)
        for joint, weight in zip(joints.T, weights.T, strict=True):
            matrices = world_from_bind[joint]
            one = np.einsum("nij,nj->ni", matrices[:, :3, :3], rows)
            moved += weight[:, None] * (one + matrices[:, :3, 3] * is_point)
        attributes[name] = add(moved.astype(np.float32))
    return {**primitive, "attributes": attributes}


def _world_from_node(nodes: list[dict[str, Any]]) -> list[np.ndarray]:
    """Return the placement of every node, (4, 4)."""
    parents = {
        child: number for number, node in enumerate(nodes) for child in node.get("children", [])
    }
    placed = []
    for number, node in enumerate(nodes):
        matrix, seen = _parent_from_node(node), {number}
        while number in parents and parents[number] not in seen:
            number = parents[number]
            seen.add(number)
            matrix = _parent_from_node(nodes[number]) @ matrix
        placed.append(matrix)
    return placed


def _parent_from_node(node: dict[str, Any]) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T  # stored by columns
    matrix = np.eye(4)
    turn = matrix_from_quat_xyzw(np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), np.float64))
    matrix[:3, :3] = turn * np.asarray(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _shown(nodes: list[dict[str, Any]], roots: list[int]) -> set[int]:
    """Return the nodes that a scene with these roots shows."""
    shown: set[int] = set()
    waiting = list(roots)
    while waiting:
        number = waiting.pop()
        if number not in shown:
            shown.add(number)
            waiting += nodes[number].get("children", [])
    return shown
