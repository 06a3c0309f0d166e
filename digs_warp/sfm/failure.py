"""Why there is no model: a diagnosis from the features and matches in the database."""

from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.device.libraries import import_pycolmap
from digs_warp.sfm.colmap import ImageSet

# If half of the images have fewer features, nothing can be matched.
FEW_FEATURES = 50

# If a homography explains this share of the matched pairs, the camera only turned, or saw one flat wall.
MOSTLY_FLAT = 0.8


def no_model_error(images: ImageSet, database: Path) -> DigsError:
    """Return the error that names the failed stage and what to try."""
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
            f"{flat_pairs} of the pairs differ only by a rotation of the camera or show one flat wall, which "
            "gives no depth: walk around the object instead of turning on the spot"
        )
    else:
        hint = "try --pairing exhaustive, more --features, a larger --feature-size, or more frames"
    return DigsError(
        f"structure from motion: 0 of {len(images.names)} images could be placed: "
        f"{np.median(features):.0f} features per image, {len(matched)} of {len(configs)} compared pairs "
        f"match; {hint}"
    )
