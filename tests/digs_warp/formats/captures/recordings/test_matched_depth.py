"""Depth of stereo pairs that came without depth: of a tilted, textured plane."""

import json
from pathlib import Path

import numpy as np

from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import read_recording
from digs_warp.formats.captures.to_capture import (
    matched_depth,
    write_capture,
)
from digs_warp.geometry.camera import Intrinsics

K = Intrinsics(160, 96, 150.0, 150.0, 80.0, 48.0)
BASELINE = 0.12


def plane_pair() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return left and right image of a plane that recedes to the right, and its depth [m] in the left one."""
    from scipy.ndimage import gaussian_filter, map_coordinates

    texture = gaussian_filter(np.random.default_rng(0).normal(size=(96, 400)), 0.8)
    texture = np.clip(128 + 90 * texture / texture.std(), 0, 255)
    rows, columns = np.mgrid[:96, :160].astype(np.float64)
    disparity = 20.0 - 0.05 * columns  # of the left pixel
    left = texture[:, 100:260]
    # Column x of the left image is at x - d(x) in the right one: the inverse of that map is linear, too.
    source = (columns + 20.0) / 1.05
    right = map_coordinates(texture, [rows, source + 100], order=1)
    images = [np.repeat(np.round(i).astype(np.uint8)[..., None], 3, axis=2) for i in (left, right)]
    return images[0], images[1], K.fx * BASELINE / disparity


def test_a_textured_plane_gets_its_depth_and_confidence() -> None:
    left, right, truth = plane_pair()
    depth, confidence = matched_depth(left, right, K, BASELINE)
    assert depth.dtype == np.float32 and confidence.dtype == np.uint8
    inner = (slice(8, -8), slice(40, -8))  # what the right eye sees, too
    known = np.isfinite(depth[inner])
    assert known.mean() > 0.95
    assert np.median(np.abs(depth - truth)[inner][known] / truth[inner][known]) < 0.01
    assert np.median(confidence[inner][known]) > 128
    assert (confidence[np.isnan(depth)] == 0).all()


def test_images_without_texture_get_no_confident_depth() -> None:
    gray = np.full((96, 160, 3), 128, np.uint8)
    depth, confidence = matched_depth(gray, gray, K, BASELINE)
    assert np.isnan(depth).all() and (confidence == 0).all()


def test_a_recording_of_two_eyes_without_depth_is_matched(tmp_path: Path) -> None:
    left, right, truth = plane_pair()
    source = tmp_path / "zed"
    write_image(source / "left000000.png", left)
    write_image(source / "right000000.png", right)
    calibration = {"fx": K.fx, "fy": K.fy, "cx": K.cx, "cy": K.cy, "baseline": BASELINE}
    (source / "calibration.json").write_text(json.dumps(calibration))
    capture = write_capture(read_recording(source, "zed"), "zed", tmp_path / "capture")
    frame = capture.frames[0]
    depth = frame.load_depth()
    assert np.nanmedian(np.abs(depth - truth)) < 0.02
    assert frame.has(Layer.CONFIDENCE) and frame.load_confidence().max() > 0.5
    assert str(capture.metric_scale) == "metres, by the depth maps"
