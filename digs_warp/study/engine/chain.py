"""Runs one case: recording -> reconstruction -> numbers. Cases share recordings and structure from motion."""

import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.files import copy_folder, digest
from digs_warp.record.lock import taking_turns
from digs_warp.record.run_log import RunRecord, versions
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.engine.case import STUDIED_CAMERA, Case, with_settings
from digs_warp.study.engine.scores import (
    OTHER_SIZES,
    YARDSTICK,
    motion_to_truth,
    score_in_true_views,
)
from digs_warp.study.scenes import processor

if TYPE_CHECKING:
    from digs_warp.pipeline.reconstruction import Reconstruction

CAPTURES = "captures"
SFM = "sfm"
WORK = "work"
STUDIED = SimulateConfig(profile=STUDIED_CAMERA)

# What makes the scene; two recordings with these in common show the same object in the same place.
SCENE_SETTINGS = ("mesh", "environment", "object_size", "unit", "up")

# Points within this distance [m] of the true surface count as on it.
SURFACE_THRESHOLD = 0.005


def run_case(case: Case, folder: Path) -> dict[str, Any]:
    """Reconstruct and return what was measured, JSON-like; only the numbers stay.

    The keys: ``metrics`` (quality on the held-out views), ``course`` (the same along iterations and
    seconds), ``yardstick`` (quality on views of a perfect camera on another walk, at four sizes: comparable
    between recordings), ``surface`` (distances of the initial points to the true surface), ``seconds`` and
    ``recording_seconds`` (of stages), ``results`` (counts), ``versions``, ``machine``.

    Args:
        case: its recording is taken from the study's ``folder`` or made there. So is structure from motion:
            the seconds of that stage are those of the first case with the same recording and settings.
        folder: of the study.
    """
    from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct

    capture = _recorded(with_settings(STUDIED, case.recording), case.recording_key, folder)
    config = with_settings(ReconstructConfig(), case.reconstruction)
    work = folder / WORK / case.key
    shutil.rmtree(work, ignore_errors=True)
    # Poses are refined after it.
    settings = replace(config.sfm, refine_poses=SfmConfig().refine_poses)
    matched = folder / SFM / digest([case.recording, settings])
    if matched.is_dir():
        copy_folder(matched, work / SFM)
    result = reconstruct(capture, config, work)
    assert result.start is not None
    log = RunRecord.find(capture.folder)
    measured = {
        "metrics": result.scores.mean.to_json(),
        "course": [row.to_json() for row in result.course if row.score],
        "seconds": dict(result.seconds),
        "recording_seconds": log.seconds if log else {},
        "results": {"initial_points": len(result.start.points), "gaussians": len(result.gaussians)},
        **_against_truth(case, config.segment.instance, capture, result, folder),
        "versions": versions(),
        "machine": processor(),
    }
    matched.parent.mkdir(exist_ok=True)
    with suppress(OSError):  # there is none, or that of another case is there
        (work / SFM).rename(matched)
    shutil.rmtree(work)
    return measured


def _recorded(config: SimulateConfig, key: str, folder: Path) -> Capture:
    from digs_warp.sim.record.record import simulate

    recording = folder / CAPTURES / key
    with taking_turns(recording):
        return simulate(config, recording, resume=True)


def _against_truth(
    case: Case, instance: int | None, capture: Capture, result: "Reconstruction", folder: Path
) -> dict[str, Any]:
    """Return the scores in true views, and on the true surface."""
    from digs_warp.measure.surface_metrics import surface_score
    from digs_warp.surface.true_surface import read_true_surface

    assert result.frames is not None and result.start is not None
    to_truth = motion_to_truth(result.frames.training, capture.frames, result.gaussians)
    yardsticks = {size: _yardstick(case, folder, size) for size in ("", *OTHER_SIZES)}
    score = score_in_true_views(result.gaussians, yardsticks, to_truth)
    surface = read_true_surface(capture.folder, instance, textured=False)
    if surface is None:
        return {"yardstick": score}
    points = surface_score(result.start.points.points_world, surface, SURFACE_THRESHOLD)
    return {"yardstick": score, "surface": {"points": points.to_json()}}


def _yardstick(case: Case, folder: Path, size: str) -> Sequence[Frame]:
    """Return views that no case has seen, at a size; they are recorded once per scene."""
    scene = {name: case.recording[name] for name in SCENE_SETTINGS if name in case.recording}
    config = with_settings(STUDIED, YARDSTICK | OTHER_SIZES.get(size, {}) | scene)
    name = f"yardstick-{size}-" if size else "yardstick-"
    return _recorded(config, f"{name}{digest(scene)}", folder).frames
