"""Frames -> `SfmModel`: the whole of structure from motion, cached and resumable in a workspace."""

import logging
import shutil
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.sfm_model import SfmModel
from digs_warp.device.libraries import import_pycolmap
from digs_warp.device.threads import default_threads
from digs_warp.poses import thresholds
from digs_warp.poses.from_images import colmap
from digs_warp.poses.from_images.colmap import ImageSet
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.image_pairs import loop_pairs, sequential_pairs
from digs_warp.poses.from_images.quality import (
    SfmQuality,
    check_agreement,
    check_completeness,
    check_motion,
    measure_quality,
    no_model_error,
)
from digs_warp.poses.from_images.rolling_shutter import correct_rolling_shutter
from digs_warp.poses.from_images.workspace import (
    IMAGES,
    MASKS,
    Workspace,
    key_of,
    sfm_model,
    with_image_files,
    with_scene_masks,
    write_model,
)
from digs_warp.record.run_log import RunLog
from digs_warp.words import counted

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class SfmResult:
    """What structure from motion found.

    Attributes:
        model: cameras and points; in [sfm] when the poses were estimated, in metres when they were given.
        is_metric: whether the poses were given, so that ``sfm_per_metre`` is 1.
        quality: how good the model is.
        seconds: time of each stage [s]; stages that were cached are near 0.
    """

    model: SfmModel
    is_metric: bool
    quality: SfmQuality
    seconds: dict[str, float]


def structure_from_motion(frames: Sequence[Frame], config: SfmConfig, workspace: Path) -> SfmResult:
    """Return cameras and sparse points of a recording (paper section 3.2).

    Features are sought in the whole image, background included: it is what holds the views together.
    With the same images and settings, what is finished in the workspace is not done again, and an interrupted
    run goes on where it stopped.

    Args:
        frames: at least three, in the order of the recording; their intrinsics are taken as known. Their
            poses serve only where ``config.poses`` asks for them, their times for a rolling shutter.
        config: what to do.
        workspace: folder for COLMAP's database and model; created when missing.

    Raises:
        DigsError: too few images or features, images that do not hang together (with the number of
            images that do), or a camera that did not move enough.
    """
    if len(frames) < thresholds.MIN_IMAGES:
        raise DigsError(
            f"structure from motion: {counted(len(frames), 'image')}, expected at least "
            f"{thresholds.MIN_IMAGES}"
        )
    _check_names_differ(frames)
    frames = with_image_files(frames, workspace / IMAGES)
    log = RunLog("sfm", config)
    images, place = ImageSet.of(frames), Workspace(workspace, key_of(frames, config))
    notes = place.prepare()
    if notes is None:
        masks = with_scene_masks(frames, images.names, workspace / MASKS)
        _find_and_match(images, config, place, masks, log)
        with log.stage("map"):
            notes = _make_model(frames, images, config, place)
        place.finish_model(notes)
    reconstruction = import_pycolmap().Reconstruction(place.model)
    model = sfm_model(reconstruction, frames, images)
    quality = measure_quality(model, len(frames), notes["models"])
    is_metric = config.poses != "sfm"
    if not is_metric:
        check_completeness(quality, config.min_registered)
        check_motion(model)
    else:
        check_agreement(quality, frames)
    logger.info("structure from motion: %s", quality)
    return SfmResult(model, is_metric, quality, log.seconds)


def _check_names_differ(frames: Sequence[Frame]) -> None:
    for name, count in Counter(frame.name for frame in frames).items():
        if count > 1:
            raise DigsError(
                f"structure from motion: {count} images share the name '{name}', by which their cameras are "
                "found again; rename the files"
            )


def _find_and_match(
    images: ImageSet, config: SfmConfig, place: Workspace, masks: Path | None, log: RunLog
) -> None:
    threads = default_threads()
    with log.stage("features"):
        colmap.extract_features(images, config, threads, place.database, masks)
    with log.stage("pairs"):
        pairs = choose_pairs(images, config, place.database)
    with log.stage("match"):
        colmap.match_pairs(images, pairs, config, threads, place.database)


def choose_pairs(images: ImageSet, config: SfmConfig, database: Path) -> list[tuple[int, int]]:
    """Return the pairs to compare; loops are found by the features in the database."""
    count = len(images.names)
    if config.pairing == "exhaustive" or (
        config.pairing == "auto" and count <= thresholds.MAX_IMAGES_EXHAUSTIVE
    ):
        return list(combinations(range(count), 2))
    pairs = set(sequential_pairs(count, config.overlap))
    if config.loop_images:
        descriptors = colmap.read_descriptors(images, database)
        pairs |= set(
            loop_pairs(descriptors, config.loop_images, config.overlap + 1, config.sfm_seed)
        )
    return sorted(pairs)


def _make_model(
    frames: Sequence[Frame], images: ImageSet, config: SfmConfig, place: Workspace
) -> dict[str, Any]:
    """Write the model folder; return what to note about it."""
    threads, database = default_threads(), place.database
    unfinished = place.folder / "mapping"
    shutil.rmtree(unfinished, ignore_errors=True)
    try:
        if config.poses == "sfm":
            models = colmap.map_images(images, config, threads, database, unfinished)
        else:
            poses = [frame.camera.world_from_cam for frame in frames]
            models = [colmap.triangulate(images, poses, config, threads, database, unfinished)]
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    if not models:
        raise no_model_error(images, database)
    if config.poses == "sfm" and config.readout_time:
        correct_rolling_shutter(models[0], frames, images, config.readout_time)
    write_model(models[0], place.model)
    return {"models": len(models), "registered": [model.num_reg_images() for model in models]}
