"""Finds out what a file or folder is, and returns the facts about it: Gaussians, runs, scenes, meshes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import NO_FILTER, Gaussians
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.engines.task import RESULTS, Results
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record import layout
from digs_warp.record.run_log import RunRecord
from digs_warp.show.report.capture_facts import (
    Facts,
    extent_words,
    megabytes,
    of_capture,
    of_data_set,
    record_facts,
    seconds_facts,
    sides_words,
)
from digs_warp.words import counted


def of_gaussians(path: Path) -> Facts:
    """Number, degree, extent, typical size and opacity."""
    return _of_gaussians(Gaussians.load(path), path)


def of_splat_file(path: Path) -> Facts:
    """The same for a PLY, SPZ or .splat file; PLY and .splat in the axes of the file."""
    from digs_warp.formats.splats.files import read_splat_file

    return _of_gaussians(read_splat_file(path), path)


def _of_gaussians(gaussians: Gaussians, path: Path, unit: str = "m") -> Facts:
    facts = {
        "kind": "Gaussians",
        "number": counted(len(gaussians), "Gaussian"),
        "spherical harmonics": f"degree {gaussians.sh_degree}",
        "file size": megabytes(path),
    }
    if gaussians.screen_filter != NO_FILTER:
        antialiased = ", antialiased" if gaussians.screen_filter.antialias else ""
        facts["drawn with"] = f"{gaussians.screen_filter.dilation:g} px² on the screen{antialiased}"
    if gaussians.world_offset is not None:
        facts["offset"] = " ".join(f"{each:g}" for each in gaussians.world_offset) + f" {unit}"
    if len(gaussians):
        size = float(np.median(np.exp(gaussians.log_scales.mean(axis=1))))
        words = f"{1e3 * size:.2f} mm" if unit == "m" else f"{size:.3g} {unit}"
        facts["extent"] = extent_words(gaussians.means, unit)
        facts["size"] = f"{words} standard deviation (median)"
        facts["opacity"] = f"{np.median(gaussians.opacities):.2f} (median)"
    if doubts := gaussians.doubts:
        facts["doubtful"] = "; ".join(doubts)
    return facts


def of_reconstruction(folder: Path) -> Facts:
    """The Gaussians, how well they match the held-out views, what each stage found, and how long it took."""
    result = Reconstruction.load(folder, partial=True)
    scale = result.poses.metric_scale
    facts = _of_gaussians(result.gaussians, folder / layout.GAUSSIANS, scale.unit if scale else "m")
    facts["kind"] = "reconstruction"
    if result.scores.views:
        facts["quality"] = result.quality
    for stage in result.figures.values():
        facts |= stage
    return facts | seconds_facts(result.run)


def of_run(folder: Path) -> Facts:
    """The results of 'digs-warp run': one line per part."""
    facts = {"kind": "results of 'digs-warp run'"}
    parts = {
        "capture": (layout.CAPTURE, of_capture, "{length}, {image size}"),
        "reconstruction": (layout.RECONSTRUCTION, of_reconstruction, "{number}, {quality}"),
    }
    for name, (place, summary, words) in parts.items():
        try:
            facts[name] = words.format(**summary(folder / place))
        except (DigsError, KeyError):
            facts[name] = "not finished"
    for name, place in {
        "scene": layout.SCENE,
        "splats": layout.SPLATS,
        "report": layout.REPORT,
    }.items():
        path = folder / place
        facts[name] = f"{path} ({megabytes(path)})" if path.is_file() else "not finished"
    return facts | record_facts(folder)


def of_many_results(folder: Path) -> Facts:
    """How many cases have a line in a folder of 'digs-warp reconstruct' or 'study run', and which failed."""
    records = Results(folder).records.values()
    failed = [str(record.get("name", record["key"])) for record in records if "error" in record]
    is_study = not any("capture" in record for record in records)
    return {
        "kind": "study" if is_study else "reconstructions",
        "length": counted(len(records), "case" if is_study else "capture"),
        "failed": ", ".join(failed) or "none",
    } | record_facts(folder)


def of_usd(path: Path, prim: str | None = None) -> Facts:
    """The content of the scene, without loading the Gaussians."""
    from digs_warp.usd.reader import describe

    scene = describe(path, prim)
    facts = {
        "kind": "USD scene",
        "Gaussians": f"{scene['splats']:,} at {scene['prim_path']}",
        "spherical harmonics": f"degree {scene['sh_degree']}",
        "precision": scene["precision"],
        "axes and unit": f"{scene['up_axis']} up, {_unit_words(scene)}",
        "color space": scene["color_space"] or "not said, taken for sRGB",
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


def describe(path: Path) -> Facts:
    """Return the facts about ``path``, the most important first."""
    if not path.exists():
        raise DigsError(f"'{path}': no such file or folder. Check the path.")
    if path.is_dir():
        return _summary_of_folder(path)(path)
    from digs_warp.formats.splats.files import CONVERTERS, SUFFIXES

    # PLY and glTF may hold meshes as well.
    by_suffix: dict[str, Callable[[Path], Facts]] = {
        ".npz": of_gaussians,
        **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), of_usd),
        **dict.fromkeys(SUFFIXES, of_splat_file),
        ".ply": of_ply,
        **dict.fromkeys((".glb", ".gltf"), of_gltf),
        **dict.fromkeys((".obj", ".stl"), of_mesh),
    }
    summary = by_suffix.get(path.suffix.lower())
    if summary is None:
        raise DigsError(
            f"'{path}': cannot tell what '{path.suffix}' is, expected one of {', '.join(by_suffix)}; "
            f"{CONVERTERS}"
        )
    return summary(path)


def _summary_of_folder(path: Path) -> Callable[[Path], Facts]:
    if (path / INDEX_NAME).is_file():
        return of_capture
    if (path / layout.GAUSSIANS).is_file():
        return of_reconstruction
    if (path / layout.CAPTURE).is_dir():
        return of_run
    if (path / layout.DATA_SET).is_file():
        return of_data_set
    if (path / RESULTS).is_file():
        return of_many_results
    if (record := RunRecord.find(path)) is not None:
        raise DigsError(
            f"'{path}': 'digs-warp {record.command}' has not finished here; run it again with --resume"
        )
    raise DigsError(
        f"'{path}': holds neither a capture ({INDEX_NAME}) nor a reconstruction ({layout.GAUSSIANS}) "
        f"nor the results of 'digs-warp run' ({layout.CAPTURE}/)"
    )


def of_gltf(path: Path) -> Facts:
    """Gaussians or a mesh, likewise."""
    from digs_warp.formats.splats.gltf import holds_splats

    return of_splat_file(path) if holds_splats(path) else of_mesh(path)


def of_ply(path: Path) -> Facts:
    """Gaussians or a mesh: a PLY file can contain either."""
    from digs_warp.data.ply_table import read_ply_header

    return of_splat_file(path) if read_ply_header(path).holds_splats else of_mesh(path)
