"""How good a sparse model is, without knowing the truth; which ones cannot be used, and why none came out."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.sfm_model import SfmModel
from digs_warp.device.libraries import import_pycolmap
from digs_warp.poses import thresholds
from digs_warp.poses.from_images.colmap import ImageSet
from digs_warp.poses.photo_matches import agreeing_shares
from digs_warp.words import counted

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class SfmQuality:
    """What tells a good model from a bad one.

    Attributes:
        images: number of images that were given.
        registered: number of images that the model places.
        models: number of models that the images fell into; one is good.
        points: number of sparse points.
        observations_per_image: mean number of points that a placed image sees.
        track_length: mean number of images that see a point.
        reprojection_error_px: mean distance [px] between where points are and where they were measured.
    """

    images: int
    registered: int
    models: int
    points: int
    observations_per_image: float
    track_length: float
    reprojection_error_px: float

    def __str__(self) -> str:
        return (
            f"{self.registered} of {counted(self.images, 'image')} in {counted(self.models, 'model')}, "
            f"{counted(self.points, 'point')} seen in "
            f"{self.track_length:.1f} images, {self.reprojection_error_px:.2f} px"
        )


def measure_quality(model: SfmModel, images: int, models: int) -> SfmQuality:
    """Return the quality of ``model``, one of ``models`` that ``images`` images gave."""
    count, points = len(model.observations), len(model.points)
    lengths = np.bincount(model.observations.points, minlength=points)
    errors = model.reprojection_errors
    return SfmQuality(
        images=images,
        registered=len(model.names),
        models=models,
        points=points,
        observations_per_image=count / max(1, len(model.names)),
        track_length=count / max(1, points),
        reprojection_error_px=float(np.average(errors, weights=lengths)) if points else 0.0,
    )


def check_completeness(quality: SfmQuality, min_registered: float) -> None:
    """Refuse a model that holds too few of the images; warn of one that holds not all.

    Raises:
        DigsError: with how many images it holds and what to try.
    """
    if quality.registered < min_registered * quality.images:
        raise DigsError(
            f"structure from motion: the largest of {quality.models} models holds {quality.registered} of "
            f"{quality.images} images, expected at least {min_registered:.0%}. The images do not hang "
            "together: record a textured surround all round and more frames, or try --pairing "
            "exhaustive, more --features, a larger --feature-size; --min-registered "
            f"{quality.registered / quality.images:.2f} goes on with this model"
        )
    if quality.registered < quality.images:
        logger.warning(
            "structure from motion: only the largest model is used: %d of %d images; the others are left out",
            *(quality.registered, quality.images),
        )


def check_agreement(quality: SfmQuality, frames: Sequence[Frame]) -> None:
    """Refuse given poses with few points, unless the matches of features agree with them.

    Few photographs from far apart share few points, however right their poses are.

    Raises:
        DigsError: with the number of points that do fit.
    """
    if quality.observations_per_image < thresholds.MIN_OBSERVATIONS:
        shares = [share for share in agreeing_shares(frames) if share is not None]
        if shares and np.median(shares) > thresholds.USUAL_MATCH_SHARE:
            logger.warning(
                "structure from motion: %d images share only %s, but %.0f %% of their matches agree with the "
                "poses",
                *(quality.images, counted(quality.points, "point"), 100 * np.median(shares)),
            )
            return
        raise DigsError(
            f"structure from motion: with the given poses {quality.images} images share only "
            f"{quality.points} points; the camera was at rest, or the poses' errors are too large, their "
            "axes are not OpenCV's, or they belong to other images: let --poses sfm estimate them. If the "
            "images show too little texture, start without matches: --strategy hull for an object with "
            "masks, else --strategy random --target-points 20000"
        )


def check_motion(model: SfmModel) -> None:
    """Refuse cameras that turned on the spot or moved along a straight line.

    Raises:
        DigsError: with the extents of the path and what to record instead.
    """
    centers = np.array([camera.center_world for camera in model.cameras])
    extents = np.linalg.svd(centers - centers.mean(axis=0), compute_uv=False) / np.sqrt(
        len(centers)
    )
    seen = model.observations
    offsets = centers[seen.cameras] - model.points.points_world[seen.points]
    distance = float(np.median(np.linalg.norm(offsets, axis=1))) if len(seen) else 0.0
    if extents[0] < thresholds.MIN_MOTION * distance:
        raise DigsError(
            f"structure from motion: the cameras moved by {extents[0] / distance:.2%} of their distance to "
            "what they see: they turned on the spot, which tells nothing about depth. Walk round the object"
        )
    if extents[1] < thresholds.MIN_PATH_WIDTH * extents[0]:
        raise DigsError(
            "structure from motion: the cameras lie on a straight line, "
            "expected a walk round the object; one line of sight leaves the turn about it undetermined"
        )


def no_model_error(images: ImageSet, database: Path) -> DigsError:
    """Return the error that says how far the images came and what to try."""
    pycolmap = import_pycolmap()
    with pycolmap.Database.open(database) as db:
        features = [db.num_keypoints_for_image(image.image_id) for image in db.read_all_images()]
        geometries = db.read_two_view_geometries()[1]
    kinds = pycolmap.TwoViewGeometryConfiguration
    useless = (kinds.UNDEFINED.value, kinds.DEGENERATE.value)
    flat = (kinds.PLANAR.value, kinds.PANORAMIC.value, kinds.PLANAR_OR_PANORAMIC.value)
    configs = [int(geometry.config) for geometry in geometries]
    matched = [config for config in configs if config not in useless]
    flat_pairs = sum(config in flat for config in matched)
    if np.median(features) < thresholds.MIN_FEATURES:
        hint = (
            "the images show too little texture: record a textured surround, or try a larger "
            "--feature-size"
        )
    elif matched and flat_pairs > thresholds.MAX_PLANAR_SHARE * len(matched):
        hint = (
            f"{flat_pairs} of the pairs differ by a turn of the camera or show one flat wall, which tells "
            "nothing about depth: walk round the object instead of turning on the spot"
        )
    else:
        hint = "try --pairing exhaustive, more --features, a larger --feature-size, or more frames"
    return DigsError(
        f"structure from motion: 0 of {len(images.names)} images could be placed: "
        f"{np.median(features):.0f} features per image, {len(matched)} of {len(configs)} compared pairs "
        f"match; {hint}"
    )
