"""Facts about USD scenes and meshes."""

from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.show.report.facts.words import Facts, extent_words, megabytes, sides_words
from digs_warp.words import counted


def of_usd(path: Path) -> Facts:
    """The content of the scene, without loading the Gaussians."""
    from digs_warp.usd.info import describe

    return facts_of_usd(describe(path))


def facts_of_usd(scene: dict[str, Any]) -> Facts:
    """Return what `digs_warp.usd.info.describe` found, in words."""
    facts = {
        "kind": "USD scene",
        "Gaussians": f"{scene['splats']:,} at {scene['prim_path']}",
        "spherical harmonics": f"degree {scene['sh_degree']}",
        "precision": scene["precision"],
        "axes and unit": f"{scene['up_axis']} up, {_unit_words(scene)}",
        "file size": f"{scene['bytes'] / 1e6:.1f} MB",
    }
    if scene["extent"]:
        facts["extent"] = extent_words(np.array(scene["extent"]) * scene["meters_per_unit"])
    for name, variants in scene["variants"].items():
        facts[f"variants of {name}"] = ", ".join(variants)
    if scene["cameras"]:
        facts["cameras"] = f"{', '.join(scene['cameras'])}; {counted(scene['views'], 'view')}"
    return facts


def _unit_words(scene: dict[str, Any]) -> str:
    """Return what a unit of a scene is; one of our reconstructions may not know it."""
    scale = scene["metadata"].get("metric_scale")
    if isinstance(scale, dict) and scale.get("known") is False:
        return f"scale unknown ({scene['meters_per_unit']:g} m per unit means nothing)"
    return f"{scene['meters_per_unit']:g} m per unit"


def of_mesh(path: Path) -> Facts:
    """The mesh as the simulator uses it: in metres, upright, at the origin."""
    from digs_warp.sim.scene.load import load_scene

    scene = load_scene(path)
    placement = scene.objects[0].placement
    assert placement is not None
    turned = (
        f", turned by {placement.turned:.1f} degrees, so that it rests" if placement.turned else ""
    )
    textured = sum(material.texture is not None for material in scene.materials)
    return {
        "kind": "mesh",
        "triangles": f"{len(scene.faces):,}",
        "vertices": f"{len(scene.vertices):,}",
        "materials": f"{len(scene.materials)}, {textured} with a texture",
        "size": f"{sides_words(scene.size)} in a capture, z up",
        "unit": placement.scale.origin,
        "up axis": f"{placement.up} of the file{turned}",
        "file size": megabytes(path),
    }
