"""The facts that `digs-warp info` prints about each kind of file or folder."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.layers import Layer
from digs_warp.data.recorded_object import RecordedObject
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record import layout
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json
from digs_warp.record.run_log import RunRecord
from digs_warp.words import counted

Facts = dict[str, str]


def describe(path: Path) -> Facts:
    """Return the facts about ``path``, the most important first."""
    if not path.exists():
        raise DigsError(f"'{path}': no such file or folder. Check the path.")
    if path.is_dir():
        return _summary_of_folder(path)(path)
    by_suffix: dict[str, Callable[[Path], Facts]] = {
        ".npz": of_gaussians,
        **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), of_usd),
        **dict.fromkeys((".spz", ".splat"), of_splat_file),
        ".ply": of_ply,
        **dict.fromkeys((".glb", ".gltf", ".obj", ".stl"), of_mesh),
    }
    summary = by_suffix.get(path.suffix.lower())
    if summary is None:
        raise DigsError(
            f"'{path}': cannot tell what '{path.suffix}' is; one of {', '.join(by_suffix)}"
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
    if (record := RunRecord.find(path)) is not None:
        raise DigsError(
            f"'{path}': 'digs-warp {record.command}' has not finished here; run it again with --resume"
        )
    raise DigsError(
        f"'{path}': holds neither a capture ({INDEX_NAME}) nor a reconstruction ({layout.GAUSSIANS}) "
        f"nor the results of 'digs-warp run' ({layout.CAPTURE}/)"
    )


def of_capture(folder: Path) -> Facts:
    """Frames, camera, rig, time span, layers, and a look at the first frame."""
    capture = read_capture(folder)
    first = capture.frames[0]
    k = first.camera.intrinsics
    span = capture.frames[-1].time - first.time
    facts = {
        "kind": "capture",
        "length": f"{counted(len(capture), 'frame')} in {span:.1f} s",
        "image size": f"{k.width} x {k.height}",
        "field of view": f"{np.rad2deg(2 * np.arctan(k.width / 2 / k.fx)):.1f} degrees horizontally",
        "baseline": _baseline(capture),
        "layers": ", ".join(layer.label for layer in Layer if first.has(layer)),
        "camera path": "unknown; reconstruct with --poses sfm",
    }
    if capture.knows_poses:
        facts["scale"] = str(capture.metric_scale)
        facts["camera path"] = _extent(
            np.stack([f.camera.center_world for f in capture.frames]), capture.metric_scale.unit
        )
    if (points := capture.load_points()) is not None:
        facts["sparse points"] = f"{len(points):,}"
    return (
        facts
        | _of_object(folder)
        | _of_objects(capture)
        | _of_frame(first)
        | _of_plausibility(capture)
        | _of_record(folder)
    )


def _of_object(folder: Path) -> Facts:
    """The size of a simulated object."""
    words = recorded_object(folder)
    return {"object size": words} if words else {}


def _of_objects(capture: Capture) -> Facts:
    """The objects of a recording of several, by their numbers."""
    objects = capture.about.objects or ()
    if len(objects) < 2:
        return {}
    named = (f"{i + 1} {each.name} ({_sides(each.size)})" for i, each in enumerate(objects))
    return {"objects": ", ".join(named)}


def recorded_object(folder: Path) -> str | None:
    """Return the size of the object of a simulated capture, and what was assumed about its file, in words."""
    found = RecordedObject.find(folder)
    if found is None:
        return None
    words = _sides(found.size)
    return words if found.up is None else f"{words}, {found.up} up in the file; {found.scale}"


def _of_frame(frame: Frame) -> Facts:
    facts: Facts = {}
    if frame.has(Layer.MASK):
        facts["object"] = f"{(frame.load_mask() > 127).mean():.1%} of the first image"
    if frame.has(Layer.DEPTH):
        depth = frame.load_depth()
        known = np.isfinite(depth)
        facts["depth"] = f"known at {known.mean():.1%} of the first image's pixels"
        if known.any():
            near, far = np.nanpercentile(depth, [1, 99])
            facts["depth"] += f", {near:.3f} m to {far:.3f} m (1st to 99th percentile)"
    return facts


def _of_plausibility(capture: Capture) -> Facts:
    """Whether depth, poses, focal length and masks fit together."""
    from digs_warp.plausibility.check import check_capture

    found = check_capture(capture)
    if found.doubts:
        return {"doubts": " ".join(found.doubts)}
    if found.agreement is None:
        return {}
    return {"agreement": f"{found.agreement.score:.0%} between neighboring frames; nothing odd"}


def of_gaussians(path: Path) -> Facts:
    """Number, degree, extent, typical size and opacity."""
    return _of_gaussians(Gaussians.load(path), path)


def of_splat_file(path: Path) -> Facts:
    """The same for a PLY, SPZ or .splat file; PLY and .splat in the axes of the file."""
    from digs_warp.interchange.splats.files import read_splat_file

    return _of_gaussians(read_splat_file(path), path)


def of_ply(path: Path) -> Facts:
    """Gaussians or a mesh: a PLY file can contain either."""
    from digs_warp.interchange.splats.ply import holds_gaussians

    return of_splat_file(path) if holds_gaussians(path) else of_mesh(path)


def _of_gaussians(gaussians: Gaussians, path: Path, unit: str = "m") -> Facts:
    facts = {
        "kind": "Gaussians",
        "number": counted(len(gaussians), "Gaussian"),
        "spherical harmonics": f"degree {gaussians.sh_degree}",
        "file size": _megabytes(path),
    }
    if len(gaussians):
        size = float(np.median(np.exp(gaussians.log_scales.mean(axis=1))))
        words = f"{1e3 * size:.2f} mm" if unit == "m" else f"{size:.3g} {unit}"
        facts["extent"] = _extent(gaussians.means, unit)
        facts["size"] = f"{words} standard deviation (median)"
        facts["opacity"] = f"{np.median(gaussians.opacities):.2f} (median)"
    return facts


def of_reconstruction(folder: Path) -> Facts:
    """The Gaussians, how well they match the held-out views, and how long it took."""
    result = Reconstruction.load(folder, partial=True)
    unit = result.metric_scale.unit if result.metric_scale else "m"
    facts = _of_gaussians(result.gaussians, folder / layout.GAUSSIANS, unit)
    facts["kind"] = "reconstruction"
    if result.metric_scale:
        facts["scale"] = str(result.metric_scale)
    if result.scores.views:
        facts["quality"] = str(result.scores)
    if distances := surface_words(result):
        facts["surface"] = ", ".join(distances)
    return facts | _of_seconds(result.run)


def surface_words(result: Reconstruction) -> list[str]:
    """Say how far the surface is from the true one and from the measured depth, where that is known."""
    words = []
    if result.surface:
        accuracy, completeness = 1e3 * result.surface.accuracy, 1e3 * result.surface.completeness
        words.append(f"accuracy {accuracy:.2f} mm, completeness {completeness:.2f} mm")
    if result.adherence is not None:
        words.append(f"adherence to the measured depth {1e3 * result.adherence:.2f} mm")
    return words


def of_data_set(folder: Path) -> Facts:
    """How many scenes there are, and which of them failed."""
    path = folder / layout.DATA_SET
    scenes = Fields(read_json(path, "data set summary"), f"data set summary '{path}'").sections(
        "scenes", []
    )
    failed = [scene.text("name") for scene in scenes if scene.text("error")]
    frames = sum(scene.whole("frames") for scene in scenes)
    return {
        "kind": "data set",
        "length": f"{counted(len(scenes), 'scene')}, {counted(frames, 'frame')}",
        "failed": ", ".join(failed) or "none",
    } | _of_record(folder)


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
    for name, place in {"scene": layout.SCENE, "report": layout.REPORT}.items():
        path = folder / place
        facts[name] = f"{path} ({_megabytes(path)})" if path.is_file() else "not finished"
    return facts | _of_record(folder)


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
        facts["extent"] = _extent(np.array(scene["extent"]) * scene["meters_per_unit"])
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
    from digs_warp.sim.load import load_scene

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
        "size": f"{_sides(scene.size)} in a capture, z up",
        "unit": placement.scale.origin,
        "up axis": f"{placement.up} of the file{turned}",
        "file size": _megabytes(path),
    }


def _of_record(folder: Path) -> Facts:
    """Stage times of the command that wrote a folder."""
    record = RunRecord.find(folder)
    return _of_seconds(record) if record else {}


def _of_seconds(record: RunRecord) -> Facts:
    seconds = ", ".join(f"{name} {value:.1f}" for name, value in record.seconds.items())
    return {"seconds": seconds} if seconds else {}


def _baseline(capture: Capture) -> str:
    if capture.rig is None:
        return "none (one camera)"
    eyes = "" if capture.rig.infrared is None else " (infrared pair)"
    return f"{capture.rig.baseline * 1e3:.1f} mm{eyes}"


def _extent(points: np.ndarray, unit: str = "m") -> str:
    return _sides(points.max(axis=0) - points.min(axis=0), unit)


def _sides(size: Iterable[float], unit: str = "m") -> str:
    return " x ".join(f"{value:.3f}" for value in size) + f" {unit}"


def _megabytes(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"
