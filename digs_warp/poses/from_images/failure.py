"""Why no model came out: told by what the features and matches in the database look like."""

from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.device.libraries import import_pycolmap
from digs_warp.poses.from_images.colmap import ImageSet

# Fewer features than this on half of the images are too few to match anything.
FEW_FEATURES = 50

# This share of the matched pairs explained by a homography alone means a turning camera or one flat wall.
MOSTLY_FLAT = 0.8


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
    if np.median(features) < FEW_FEATURES:
        hint = (
            "the images show too little texture: record a textured surround, or try a larger "
            "--feature-size"
        )
    elif matched and flat_pairs > MOSTLY_FLAT * len(matched):
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
