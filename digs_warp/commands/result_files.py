"""The names of the files that commands write: patterns with ``*``, relative to the folder of the result."""

from digs_warp.data.imu import IMU, IMU_TRUE
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.layers import Layer
from digs_warp.record import layout


def capture_files() -> list[str]:
    """Return what `simulate` writes."""
    images = [layer.pattern.replace("{:04d}", "*") for layer in Layer]
    return [INDEX_NAME, layout.SENSOR_PLAN, IMU, IMU_TRUE, *images]


def reconstruction_files() -> list[str]:
    """Return what `reconstruct` writes."""
    from digs_warp.data.posed_frames import CAMERAS
    from digs_warp.masks.masks import SETTINGS
    from digs_warp.pipeline.front_end import HELD_OUT, MASKS, MENDED, SFM
    from digs_warp.pipeline.stored_views import RENDERS
    from digs_warp.poses.from_images.workspace import DATABASE, IMAGES, MODEL, STAGES

    in_sfm = (f"{DATABASE}*", f"{MODEL}/*", STAGES, f"{IMAGES}/*.png")
    in_held_out = (f"{HELD_OUT}/*.png", f"{HELD_OUT}/{SETTINGS}")
    in_masks = ("*.png", SETTINGS, *in_held_out, f"{MENDED}/*.png")
    return [
        *(layout.INITIAL_POINTS, layout.CHECKPOINT, layout.TRAINING, layout.GAUSSIANS),
        *(layout.EVALUATION, CAMERAS, f"{layout.COURSE}/*.npz", f"{RENDERS}/*.png"),
        *(f"{SFM}/{name}" for name in in_sfm),
        *(f"{MASKS}/{name}" for name in in_masks),
    ]


def run_files() -> list[str]:
    """Return what `run` writes."""
    parts = {layout.CAPTURE: capture_files(), layout.RECONSTRUCTION: reconstruction_files()}
    both = (layout.RUN_RECORD, layout.MANIFEST)
    inner = [f"{part}/{name}" for part, names in parts.items() for name in (*names, *both)]
    return [layout.SCENE, layout.SPLATS, layout.REPORT, *inner]
