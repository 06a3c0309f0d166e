"""Runs one case: recording -> reconstruction -> numbers. Recordings are shared between cases.

So is structure from motion with the same settings: one case makes it before its own clocks start, the others
take it. Cases that run at the same time wait for each other where they share.
"""

import resource
import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.files import copy_folder, digest, read_json, to_json, write_atomically
from digs_warp.record.lock import taking_turns
from digs_warp.record.run_log import RunRecord, versions
from digs_warp.record.typed import to_json as record_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.engine.case import STUDIED_CAMERA, Case, with_settings
from digs_warp.study.engine.placement import mesh_in_place, motion_to_truth
from digs_warp.study.engine.scores import OTHER_SIZES, YARDSTICK, psnr_in_place, score_on_yardstick
from digs_warp.study.timing import Stopwatch, processor

if TYPE_CHECKING:
    from digs_warp.pipeline.reconstruct import ReconstructConfig
    from digs_warp.pipeline.reconstruction import Reconstruction

CAPTURES = "captures"
SFM = "sfm"
WORK = "work"
STUDIED = SimulateConfig(profile=STUDIED_CAMERA)
NOTE = "study.json"  # beside shared structure from motion: the seconds that it took
MATCHING = "structure from motion"  # as the stage is called

# What makes the scene; two recordings with these in common show the same object in the same place.
SCENE_SETTINGS = ("mesh", "environment", "object_size", "unit", "up")

# Points within this distance [m] of the true surface count as on it.
SURFACE_THRESHOLD = 0.005


def record_case(case: Case, folder: Path) -> Capture:
    """Return the recording of a case; it is made when the study's ``folder`` does not hold it yet."""
    return _recorded(with_settings(STUDIED, case.recording), case.recording_key, folder)


def run_case(case: Case, folder: Path) -> dict[str, Any]:
    """Reconstruct and return what was measured, JSON-like; only the numbers stay.

    The keys: ``metrics`` (quality on the held-out views), ``course`` (the same along iterations and
    seconds), ``yardstick`` (quality on views of a perfect camera on another walk, at four sizes: comparable
    between recordings), ``surface`` (distances of points and Gaussians to the true surface),
    ``seconds`` (of stages; compiling kernels apart),
    ``cpu_seconds`` (of all threads, but for the recording and structure from motion), ``recording_seconds``,
    ``results`` (counts), ``memory_mb`` (peak until the result is there), ``versions``, ``machine``.

    Args:
        case: its recording is taken from the study's ``folder`` or made there; structure from motion with
            the same settings, too, with the time that it took.
        folder: of the study.
    """
    from digs_warp.device.warp_start import compile_seconds
    from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct

    capture = record_case(case, folder)
    config = with_settings(ReconstructConfig(), case.reconstruction)
    work = _workplace(case, capture, config, folder)
    before = compile_seconds()
    with Stopwatch() as watch:
        result = reconstruct(capture, config, work)
    compiling = compile_seconds() - before
    memory = _peak_memory_mb()
    measured = _measure(result)
    if _is_shared(config) and MATCHING in measured["seconds"]:  # it read what is there
        measured["seconds"][MATCHING] = _matching_seconds(case, config, folder)
    measured |= _against_truth(case, config, capture, result, folder)
    measured |= {
        "cpu_seconds": round(watch.cpu_seconds, 3),
        "recording_seconds": _recording_seconds(capture),
        "memory_mb": memory,
        "versions": versions(),
        "machine": processor(),
    }
    measured["seconds"]["compile kernels"] = round(compiling, 3)
    shutil.rmtree(work)
    return measured


def _workplace(case: Case, capture: Capture, config: "ReconstructConfig", folder: Path) -> Path:
    """Return a folder for a case, empty but for structure from motion where the case needs it."""
    work = folder / WORK / case.key
    shutil.rmtree(work, ignore_errors=True)
    if _is_shared(config):
        matched = _matched(case, config, folder)
        _match_once(capture, config.sfm, matched)
        copy_folder(matched, work / SFM)
    return work


def _is_shared(config: "ReconstructConfig") -> bool:
    # What the others match depends on the poses that they find; it is left to the case.
    return config.needs_sfm and config.sfm.poses in ("sfm", "capture")


def _matched(case: Case, config: "ReconstructConfig", folder: Path) -> Path:
    """Return where structure from motion is shared with the cases of the same settings."""
    # Poses are refined after it.
    settings = replace(config.sfm, refine_poses=SfmConfig().refine_poses)
    return folder / SFM / digest([case.recording, settings])


def _match_once(capture: Capture, config: SfmConfig, matched: Path) -> None:
    """Do structure from motion in ``matched`` unless that is done; one case does it while others wait.

    The note with its time is written last; what a killed case had begun goes on.
    """
    from digs_warp.pipeline.poses import match_images

    with taking_turns(matched):
        if (matched / NOTE).is_file():
            return
        with Stopwatch() as watch:
            match_images(capture, config.for_capture(capture), matched)
        write_atomically(matched / NOTE, to_json({"seconds": round(watch.seconds, 4)}).encode())


def _matching_seconds(case: Case, config: "ReconstructConfig", folder: Path) -> float:
    return read_json(_matched(case, config, folder) / NOTE, "note")["seconds"]


def _recorded(config: SimulateConfig, key: str, folder: Path) -> Capture:
    from digs_warp.sim.record.record import simulate

    recording = folder / CAPTURES / key
    with taking_turns(recording):
        return simulate(config, recording, resume=True)


def _measure(result: "Reconstruction") -> dict[str, Any]:
    stages = [record_json(each) for each in (result.poses, result.training, result.scores)]
    known = {name: value for stage in stages for name, value in stage.items()}
    return {
        "metrics": result.scores.mean.to_json(),
        "course": [row.to_json() for row in result.course if row.score],
        "seconds": dict(result.seconds),
        "results": known | {"initial_points": len(result.start.points) if result.start else None},
    }


def _recording_seconds(capture: Capture) -> dict[str, float]:
    record = RunRecord.find(capture.folder)
    return record.seconds if record else {}


def _against_truth(
    case: Case,
    config: "ReconstructConfig",
    capture: Capture,
    result: "Reconstruction",
    folder: Path,
) -> dict[str, Any]:
    assert result.frames is not None and result.start is not None
    yardstick = _yardstick(case, folder)
    score = score_on_yardstick(result.gaussians, yardstick)
    to_truth = motion_to_truth(result.frames.training, capture.frames, result.gaussians)
    score["psnr_object_in_place"] = psnr_in_place(result.gaussians, yardstick, to_truth)
    for size in OTHER_SIZES:
        seen = _yardstick(case, folder, size)
        score[f"psnr_object_in_place_{size}"] = psnr_in_place(result.gaussians, seen, to_truth)
    return {
        "yardstick": score,
        "surface": _surface_scores(capture, config, result, to_truth),
    }


def _yardstick(case: Case, folder: Path, size: str = "") -> Sequence[Frame]:
    """Return views that no case has seen, at another ``size`` if given; they are recorded once per scene."""
    scene = {name: case.recording[name] for name in SCENE_SETTINGS if name in case.recording}
    config = with_settings(STUDIED, YARDSTICK | OTHER_SIZES.get(size, {}) | scene)
    name = f"yardstick-{size}-" if size else "yardstick-"
    return _recorded(config, f"{name}{digest(scene)}", folder).frames


def _surface_scores(
    capture: Capture, config: "ReconstructConfig", result: "Reconstruction", to_truth: np.ndarray
) -> dict[str, Any]:
    """Return how far points and centers are from the true surface, and the rendered surface in its place."""
    from digs_warp.measure.surface_metrics import surface_score
    from digs_warp.surface.rendered import surface_error
    from digs_warp.surface.true_surface import read_true_surface

    surface = read_true_surface(capture.folder, config.segment.instance, textured=False)
    if surface is None or result.frames is None or result.start is None:
        return {}
    points, gaussians = result.start.points, result.gaussians
    frames = (*result.frames.training, *result.frames.held_out)
    rendered = surface_error(gaussians, frames, mesh_in_place(surface, to_truth))
    return {
        "points": surface_score(points.points_world, surface, SURFACE_THRESHOLD).to_json(),
        "gaussians": surface_score(gaussians.means, surface, SURFACE_THRESHOLD).to_json(),
        "accuracy_in_place": None if rendered is None else rendered.accuracy,
    }


def _peak_memory_mb() -> float:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Linux counts kibibytes, macOS bytes.
    return round(peak / (1 << 20 if sys.platform == "darwin" else 1 << 10), 1)
