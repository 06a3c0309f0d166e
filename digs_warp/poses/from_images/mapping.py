"""The calls into COLMAP that place cameras and points: mapping and triangulation, with progress and Ctrl-C.

What COLMAP is told here decides the result, so every option that is not its default says why.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses import thresholds
from digs_warp.poses.from_images.colmap import ImageSet, quiet_pycolmap, run_interruptible
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.progress import progress

# All images are adjusted together when their number, or that of the points, has grown by this factor.
GLOBAL_ADJUSTMENT_GROWTH = 1.4
# Share by which the error has to fall in a step of an adjustment for another step to follow.
LEAST_GAIN = 1e-5


def map_images(
    images: ImageSet, config: SfmConfig, threads: int, database: Path, folder: Path
) -> list[Any]:
    """Place the cameras and return all models that came out, the largest first.

    Returns:
        pycolmap.Reconstruction objects; COLMAP also writes them into ``folder``.
    """
    pycolmap = quiet_pycolmap()
    pycolmap.set_random_seed(config.sfm_seed)
    folder.mkdir(parents=True, exist_ok=True)
    placed: list[int] = []  # counted on COLMAP's thread, shown by this one
    call = partial(
        pycolmap.incremental_mapping,
        *(database, images.root, folder, incremental_options(pycolmap, config, threads)),
        initial_image_pair_callback=lambda: placed.append(2),
        next_image_callback=lambda: placed.append(1),
    )
    with progress(len(images.names), "Placing cameras", "image") as bar:
        models = run_interruptible(call, lambda: _show(bar, sum(placed)))
    return sorted(models.values(), key=lambda model: -model.num_reg_images())


def incremental_options(pycolmap: Any, config: SfmConfig, threads: int) -> Any:
    """Return how COLMAP places cameras one by one, and triangulates points."""
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = threads
    options.random_seed = config.sfm_seed
    options.min_model_size = thresholds.MIN_MODEL_IMAGES
    # Bundle adjustment of all images runs as often as COLMAP itself has it for videos, and stops where it no
    # longer gains: on 14 photographs of 1600x900 that saves a quarter of the time at the same errors.
    options.ba_global_frames_ratio = options.ba_global_points_ratio = GLOBAL_ADJUSTMENT_GROWTH
    options.ba_global_function_tolerance = options.ba_local_function_tolerance = LEAST_GAIN
    # A capture's images are free of distortion.
    options.ba_refine_focal_length = config.refine_focal
    options.ba_refine_extra_params = False
    options.mapper.abs_pose_refine_focal_length = config.refine_focal
    options.mapper.abs_pose_refine_extra_params = False
    return options


def triangulate(
    images: ImageSet,
    world_from_cams: Sequence[np.ndarray],
    config: SfmConfig,
    threads: int,
    database: Path,
    folder: Path,
) -> Any:
    """Return the model of the given poses (4, 4) with the points that the matches give in them."""
    pycolmap = quiet_pycolmap()
    model = _model_of_known_poses(pycolmap, images, world_from_cams, database)
    options = incremental_options(pycolmap, config, threads)
    folder.mkdir(parents=True, exist_ok=True)
    paths = database, images.root, folder
    with progress(len(images.names), "Triangulating", "image") as bar:
        model = run_interruptible(
            partial(pycolmap.triangulate_points, model, *paths, options=options)
        )
        _show(bar, bar.total)
    model.extract_colors_for_all_images(images.root)
    return model


def _model_of_known_poses(
    pycolmap: Any, images: ImageSet, world_from_cams: Sequence[np.ndarray], database: Path
) -> Any:
    model = pycolmap.Reconstruction()
    with pycolmap.Database.open(database) as db:
        by_name = {image.name: image for image in db.read_all_images()}
        for camera in db.read_all_cameras():
            model.add_camera_with_trivial_rig(camera)
    for name, world_from_cam in zip(images.names, world_from_cams, strict=True):
        known = by_name[name]
        image = pycolmap.Image(name=name, camera_id=known.camera_id, image_id=known.image_id)
        pose = pycolmap.Rigid3d(invert_rigid(world_from_cam)[:3])
        model.add_image_with_trivial_frame(image, pose)
    return model


def _show(bar: Any, count: int) -> None:
    bar.update(min(count, bar.total) - bar.n)
