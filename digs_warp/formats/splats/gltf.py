"""Gaussians in glTF: the extension KHR_gaussian_splatting of Khronos, in GLB files.

Points with attributes: standard deviations and opacities as they are (no logarithms, no logits), quaternions
xyzw, spherical harmonics with our signs, +Y up, in metres. ``COLOR_0`` has the color without view dependence,
linear, for programs that know only points. Renderers are those of 3D Gaussian splatting and add 0.3 px^2 on
the screen; what our splats are drawn with stands in ``extras``, which only we read.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.bounds import GAUSSIANS
from digs_warp.checks import DigsError, require_file
from digs_warp.data.gaussians import CLASSIC, Gaussians, ScreenFilter, joined
from digs_warp.data.glb import POINTS, glb_file
from digs_warp.data.images import linear_from_srgb, to_uint8
from digs_warp.formats.splats.rows import WORLD_FROM_Y_UP, sound, turned
from digs_warp.geometry.sh import C0, MAX_DEGREE, coefficient_count
from digs_warp.record.files import write_atomically
from digs_warp.sim.scene.mesh.gltf import SPLATS, GltfNumbers, parent_from_node, read_gltf_header
from digs_warp.usd.convert import (
    SplatArrays,
    arrays_from_gaussians,
    check_activated,
    gaussians_from_arrays,
    srgb_coefficients,
    transformed,
)
from digs_warp.usd.frames import similarity_from_matrix

LINEAR, DISPLAY = "lin_rec709_display", "srgb_rec709_display"

_NOTE = "digs_warp"  # in the extras of the primitive
_MOST_NODES = 10_000


def holds_splats(path: Path) -> bool:
    """Whether a glTF file has Gaussians; it may have triangles, too."""
    with sound(f"glTF '{path}'"):
        return any(True for _ in _primitives(read_gltf_header(path)))


def read_gltf(path: Path) -> Gaussians:
    """Read all Gaussians of the scene in a .glb or .gltf file.

    Raises:
        DigsError: no Gaussians, compressed ones, a damaged file, or values that are no scales or opacities.
    """
    what = f"glTF '{path}'"
    header = read_gltf_header(require_file(path, "glTF"))
    numbers = GltfNumbers(path, header)
    with sound(what):
        parts = [
            _read_primitive(numbers, header, primitive, world_from_node, what)
            for primitive, world_from_node in _primitives(header)
        ]
    if not parts:
        raise DigsError(f"{what}: no {SPLATS} in it, so no Gaussians: a mesh?")
    return joined(parts)


def write_gltf(path: Path, gaussians: Gaussians) -> None:
    """Write Gaussians of our world as GLB, float32.

    Raises:
        DigsError: values that are not finite.
    """
    what = f"glTF '{path}'"
    arrays = arrays_from_gaussians(turned(gaussians, WORLD_FROM_Y_UP.T), what)
    color = np.clip(0.5 + C0 * arrays.sh[:, 0], 0, 1)
    attributes = {
        "POSITION": arrays.positions,
        "COLOR_0": to_uint8(np.column_stack([linear_from_srgb(color), arrays.opacities])),
        f"{SPLATS}:ROTATION": arrays.orientations,
        f"{SPLATS}:SCALE": arrays.scales,
        f"{SPLATS}:OPACITY": arrays.opacities,
    }
    names = _coefficient_names(gaussians.sh_degree)
    attributes |= {name: arrays.sh[:, i] for i, name in enumerate(names)}
    floats = {
        name: values if values.dtype == np.uint8 else values.astype("<f4")
        for name, values in attributes.items()
    }
    extension = {
        "kernel": "ellipse",
        "colorSpace": DISPLAY,
        "projection": "perspective",
        "sortingMethod": "cameraDistance",
    }
    note = {
        "dilation_px2": gaussians.screen_filter.dilation,
        "antialias": gaussians.screen_filter.antialias,
    }
    primitive = {"mode": POINTS, "extensions": {SPLATS: extension}, "extras": {_NOTE: note}}
    document = {"extensionsUsed": [SPLATS]}
    write_atomically(path, glb_file("splats", floats, None, primitive, document))


def _coefficient_names(degree: int) -> list[str]:
    return [
        f"{SPLATS}:SH_DEGREE_{band}_COEF_{number}"
        for band in range(degree + 1)
        for number in range(2 * band + 1)
    ]


def _primitives(header: dict[str, Any]) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """Yield the primitives of Gaussians that the scene shows, and the transforms that they are under."""
    nodes, meshes = header.get("nodes", []), header.get("meshes", [])
    scene = header["scenes"][header.get("scene", 0)]
    places = [(number, np.eye(4)) for number in scene.get("nodes", [])]
    for count, (number, above) in enumerate(places):  # grows
        if count > _MOST_NODES:
            raise ValueError(f"more than {_MOST_NODES} nodes, or nodes in a circle")
        node = nodes[number]
        here = above @ parent_from_node(node)
        places += [(child, here) for child in node.get("children", [])]
        for primitive in meshes[node["mesh"]]["primitives"] if "mesh" in node else ():
            if SPLATS in primitive.get("extensions", {}):
                yield primitive, here


def _read_primitive(
    numbers: GltfNumbers,
    header: dict[str, Any],
    primitive: dict[str, Any],
    file_from_node: np.ndarray,
    what: str,
) -> Gaussians:
    attributes, extension = primitive["attributes"], primitive["extensions"][SPLATS]
    needed = ("ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0")
    lacking = [name for name in needed if f"{SPLATS}:{name}" not in attributes]
    if lacking or extension.get("kernel", "ellipse") != "ellipse":
        compressed = ", ".join(extension.get("extensions", {})) or extension.get("kernel", "")
        raise DigsError(
            f"{what}: splats without {', '.join(lacking) or 'the usual kernel'}"
            f"{f' ({compressed})' if compressed else ''}; export it as plain {SPLATS}, or as PLY or SPZ"
        )
    GAUSSIANS.check(what, header["accessors"][attributes["POSITION"]]["count"])

    def values(name: str) -> np.ndarray:
        return numbers.values(attributes[name]).astype(np.float32)

    degree = max(d for d in range(MAX_DEGREE + 1) if f"{SPLATS}:SH_DEGREE_{d}_COEF_0" in attributes)
    coefficients = [values(name) for name in _coefficient_names(degree)]
    sh = np.stack(coefficients, axis=1).reshape(-1, coefficient_count(degree), 3)
    if extension.get("colorSpace") == LINEAR:
        sh = srgb_coefficients(sh)
    arrays = SplatArrays(
        values("POSITION"),
        values(f"{SPLATS}:ROTATION"),
        values(f"{SPLATS}:SCALE"),
        values(f"{SPLATS}:OPACITY")[:, 0],
        sh,
    )
    check_activated(arrays, what)
    world_from_file = np.eye(4)
    world_from_file[:3, :3] = WORLD_FROM_Y_UP
    with np.errstate(invalid="ignore"):  # the caller decides about broken rows
        arrays = transformed(arrays, similarity_from_matrix(world_from_file @ file_from_node, what))
    note = primitive.get("extras", {}).get(_NOTE)
    made_for = CLASSIC
    if isinstance(note, dict):
        made_for = ScreenFilter(float(note["dilation_px2"]), bool(note["antialias"]))
    return replace(gaussians_from_arrays(arrays), screen_filter=made_for)
