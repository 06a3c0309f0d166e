"""Lenses, cameras in other places, and depth of stereo pairs that came without."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import read_recording
from digs_warp.formats.captures.lens import Lens, PinholeView, register_depth, undistorted
from digs_warp.formats.captures.to_capture import matched_depth, write_capture
from digs_warp.geometry.camera import Intrinsics, pixel_centers


def test_distortion_is_taken_out() -> None:
    k = Intrinsics(200, 150, 160.0, 165.0, 97.0, 78.0)
    coefficients = (-0.2, 0.05, 0.002, -0.001)
    # A picture whose value at a pixel says where it lies, to a quarter of a pixel, seen through the lens.
    centers = pixel_centers(200, 150)
    ramp = np.clip(4 * centers[..., 0], 0, 255).astype(np.uint8)
    view = undistorted(k, Lens(coefficients))
    assert view is not None and view.target == k and not view.outside().any()
    found = view.apply(ramp)
    x, y = (centers[..., 0] - k.cx) / k.fx, (centers[..., 1] - k.cy) / k.fy
    r2 = x**2 + y**2
    k1, k2, p1, p2 = coefficients
    distorted = x * (1 + k1 * r2 + k2 * r2**2) + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    expected = distorted * k.fx + k.cx
    side = np.s_[15:-15, 8:45]  # where half a pixel in the lens's center would show
    difference = found[side] / 4 - expected[side]
    assert np.abs(difference).max() < 0.4 and abs(difference.mean()) < 0.02


BROWN = (-0.3, 0.1, 0.002, -0.001, 0.01, 0.05, -0.02, 0.01)


@pytest.mark.parametrize("lens", [Lens(BROWN), Lens((0.02, -0.01, 0.004, -0.001), is_fisheye=True)])
def test_lenses_bend_light_as_opencv_says(lens: Lens) -> None:
    rng = np.random.default_rng(0)
    rays = np.concatenate([rng.uniform(-0.8, 0.8, (500, 2)), np.ones((500, 1))], axis=1)
    nothing, coefficients = np.zeros(3), np.array(lens.coefficients)
    module = cv2.fisheye if lens.is_fisheye else cv2
    expected, _ = module.projectPoints(rays[:, None], nothing, nothing, np.eye(3), coefficients)
    np.testing.assert_allclose(lens.distort(rays), expected[:, 0], atol=1e-12)


def test_rays_that_a_lens_does_not_show_are_black_and_without_depth() -> None:
    k = Intrinsics(60, 40, 30.0, 30.0, 30.0, 20.0)
    # From r = 1 / sqrt(0.9) on, this polynomial runs backward: there it would show the image again.
    folding = PinholeView(k, Lens((-0.3, 0.0, 0.0, 0.0)), k).with_field_of_view(150)
    assert folding.target.cx == 30 and folding.target.fx == pytest.approx(
        30 / np.tan(np.deg2rad(75))
    )
    image, depth = np.full((40, 60, 3), 200, np.uint8), np.full((40, 60), 2.0, np.float32)
    seen, found = folding.apply(image), folding.apply(depth, nearest=True)
    centers = (pixel_centers(60, 40) - [30, 20]) / folding.target.fx
    far = np.hypot(*np.moveaxis(centers, -1, 0)) > 1 / np.sqrt(0.9)
    assert (seen[far] == 0).all() and np.isnan(found[far]).all()
    assert (seen[18:22, 28:32] == 200).all() and (found[18:22, 28:32] == 2).all()
    outside = folding.outside()
    assert (
        0.5 < outside.mean() < 1 and outside[far].all() and not outside[seen[..., 0] == 200].any()
    )


def test_depth_of_a_camera_beside_is_seen_from_the_color_camera() -> None:
    depth_camera, color_camera = (
        Intrinsics(40, 30, 40.0, 40.0, 20.0, 15.0),
        Intrinsics(80, 60, 90.0, 90.0, 41.0, 29.0),
    )
    color_from_depth = np.eye(4)
    color_from_depth[:3, 3] = [-0.1, 0.02, 0.05]
    # A near square before a wall: it hides another part of the wall from the camera beside.
    depth = np.full((30, 40), 2.0, np.float32)
    depth[10:20, 15:25] = 1.0
    depth[0, 0] = np.nan
    found = register_depth(depth, depth_camera, color_camera, color_from_depth)
    near = [(u - 20) / 40 - 0.1 for u in (15, 25)], [(v - 15) / 40 + 0.02 for v in (10, 20)]
    left, right = (90 * x / 1.05 + 41 for x in near[0])
    top, bottom = (90 * y / 1.05 + 29 for y in near[1])
    u, v = np.moveaxis(pixel_centers(80, 60), -1, 0)
    inside = (u > left) & (u < right) & (v > top) & (v < bottom)
    np.testing.assert_allclose(found[inside], 1.05, rtol=1e-6)
    assert set(np.unique(found[~inside & np.isfinite(found)]).tolist()) == {np.float32(2.05)}
    # The shadow of the square, between its left edge here and that on the wall, has no depth.
    shadow = (
        (u > right) & (u < 90 * (2 * 5 / 40 - 0.1) / 2.05 + 41) & (v > top + 1) & (v < bottom - 1)
    )
    assert shadow.any() and np.isnan(found[shadow]).all()
    # Not a hole elsewhere, although each pixel became more than four.
    assert np.isfinite(found[5:50, 5:25]).all()


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
