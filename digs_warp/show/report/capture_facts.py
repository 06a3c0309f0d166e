"""Facts about recordings, and about folders of many."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from digs_warp.data.about import RecordedObject
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.record import layout
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json
from digs_warp.record.run_log import RunRecord
from digs_warp.words import counted

# What is known of a file or folder: names and values, the most important first.
Facts = dict[str, str]

# The sides of what is smaller are told in millimetres [m].
SMALL = 0.1


def record_facts(folder: Path) -> Facts:
    """Stage times of the command that wrote a folder."""
    record = RunRecord.find(folder)
    return seconds_facts(record) if record else {}


def seconds_facts(record: RunRecord) -> Facts:
    """Stage times of a record; nothing where it has none."""
    seconds = ", ".join(f"{name} {value:.1f}" for name, value in record.seconds.items())
    return {"seconds": seconds} if seconds else {}


def extent_words(points: np.ndarray, unit: str = "m") -> str:
    """The sides of the box around points, shape (n, 3), n > 0."""
    return sides_words(points.max(axis=0) - points.min(axis=0), unit)


def sides_words(size: Iterable[float], unit: str = "m") -> str:
    """The sides of a box, in ``unit``; what is smaller than a hand, in millimetres."""
    sides = [float(value) for value in size]
    if unit == "m" and max(sides) < SMALL:
        return " x ".join(f"{1e3 * value:.3g}" for value in sides) + " mm"
    return " x ".join(f"{value:.3f}" for value in sides) + f" {unit}"


def megabytes(path: Path) -> str:
    """The size of a file."""
    return f"{path.stat().st_size / 1e6:.1f} MB"


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
        "camera path": f"unknown; reconstruct with --poses sfm{' or rgbd' if capture.has_depth else ''}",
    }
    if capture.knows_poses:
        facts["scale"] = str(capture.metric_scale)
        facts["camera path"] = extent_words(
            np.stack([f.camera.center_world for f in capture.frames]), capture.metric_scale.unit
        )
    if capture.about.world_offset is not None:
        facts["offset of the world"] = " ".join(f"{x:g} m" for x in capture.about.world_offset)
    if (points := capture.load_points()) is not None:
        facts["sparse points"] = f"{len(points):,}"
    return (
        facts
        | ({"object size": words} if (words := recorded_object(folder)) else {})
        | _of_objects(capture)
        | _of_frame(first)
        | _of_plausibility(capture)
        | record_facts(folder)
    )


def _of_objects(capture: Capture) -> Facts:
    """The objects of a recording of several, by their numbers."""
    objects = capture.about.objects or ()
    if len(objects) < 2:
        return {}
    named = (f"{i + 1} {each.name} ({sides_words(each.size)})" for i, each in enumerate(objects))
    return {"objects": ", ".join(named)}


def recorded_object(folder: Path) -> str | None:
    """Return the size of the object of a simulated capture, and what was assumed about its file, in words."""
    found = RecordedObject.find(folder)
    if found is None:
        return None
    words = sides_words(found.size)
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
    from digs_warp.check.check import check_capture

    found = check_capture(capture, "info")
    if found.findings:
        return {"findings": " ".join(map(str, found.findings))}
    if found.agreement is None:
        return {}
    return {"agreement": f"{found.agreement.score:.0%} between neighboring frames; no finding"}


def _baseline(capture: Capture) -> str:
    if capture.rig is None:
        return "none (one camera)"
    eyes = "" if capture.rig.infrared is None else " (infrared pair)"
    return f"{capture.rig.baseline * 1e3:.1f} mm{eyes}"


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
    } | record_facts(folder)
