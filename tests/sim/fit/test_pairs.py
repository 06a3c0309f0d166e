"""Stereo pairs with true disparity: reading them, making the right image, predicting what was held out."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.images import write_image
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.fit.eye_noise import Eyes, eye_noise
from digs_warp.sim.fit.fit_pair import (
    LEFT,
    RIGHT,
    fit_part,
    image_parts,
    pair_rig,
    try_noise,
)
from digs_warp.sim.fit.known_frame import known_frame
from digs_warp.sim.fit.known_pair import filled, right_image, without_grain
from digs_warp.sim.fit.pair_folder import is_pair, read_pair
from digs_warp.sim.fit.pair_scores import BAD, RMS, excess_variance, scores
from digs_warp.sim.fit.result import with_figures
from digs_warp.sim.fit.sensing import ON_IMAGES
from digs_warp.sim.fit.textured_wall import Place, photograph
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.effects.static_field import unit_field
from reference.stereo_frames import broadband


def write_middlebury(folder: Path, disparity: np.ndarray) -> None:
    """A pair as Middlebury stores it: rows from below, infinity where nothing is known."""
    height, width = disparity.shape
    for name in ("im0.png", "im1.png"):
        write_image(folder / name, broadband((height, width)))
    pixels = np.where(np.isnan(disparity), np.inf, disparity).astype("<f4")[::-1]
    (folder / "disp0.pfm").write_bytes(f"Pf\n{width} {height}\n-1.0\n".encode() + pixels.tobytes())
    (folder / "calib.txt").write_text(
        "cam0=[500.5 0 31.5; 0 500.5 24.25; 0 0 1]\ncam1=[500.5 0 40; 0 500.5 24.25; 0 0 1]\n"
        "doffs=8.5\nbaseline=193.001\nwidth=64\nheight=48\nndisp=64\n"
    )


def test_a_folder_of_middlebury_is_read(tmp_path: Path) -> None:
    disparity = np.arange(48 * 64, dtype=np.float64).reshape(48, 64) / 64 + 1
    disparity[3, 5] = np.nan
    write_middlebury(tmp_path, disparity)
    pair = read_pair(tmp_path)
    assert is_pair(tmp_path)
    np.testing.assert_array_equal(pair.disparity, disparity)
    k = pair.intrinsics
    assert (k.width, k.height, k.fx, k.cx, k.cy) == (64, 48, 500.5, 31.5, 24.25)
    assert pair.baseline == pytest.approx(0.193001)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("disp0.pfm", b"PF\n64 48\n-1.0\n" + bytes(64 * 48 * 12), "not a gray PFM image"),
        ("disp0.pfm", b"Pf\n64 48\n-1.0\n" + bytes(100), "100 bytes of pixels, expected 12,288"),
        ("disp0.pfm", b"Pf\n64", "three lines of header"),
        ("disp0.pfm", b"Pf\n64 48\n-1.0\n" + bytes(64 * 48 * 4), "no disparity is known"),
        ("disp0.pfm", b"Pf\n900000 900000\n-1.0\n", "pixels, expected up to"),
        ("calib.txt", b"cam0=[500 0 32; 0 500 24; 0 0 1]\n", "'baseline=...' in mm"),
        ("calib.txt", b"cam0=[500 0]\nbaseline=100\n", "expected lines 'cam0="),
        ("calib.txt", b"cam0=[500 0 32; 0 500 24; 0 0 1]\nbaseline=-3\n", "above 0"),
    ],
)
def test_broken_pairs_are_refused_by_name(
    tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    write_middlebury(tmp_path, np.full((48, 64), 9.0))
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DigsError, match=message) as error:
        read_pair(tmp_path)
    assert str(tmp_path) in str(error.value)


def test_our_own_layout_is_read_with_metres_or_millimetres(tmp_path: Path) -> None:
    for side in ("left", "right"):
        write_image(tmp_path / f"{side}.png", broadband((48, 64)))
    np.savez(tmp_path / "disp.npz", np.full((48, 64), 9.0, np.float32))
    calibration = {"fx_px": 400.0, "cx_px": 30.0, "cy_px": 20.0}
    for unit, value in (("baseline_m", 0.05), ("baseline_mm", 50.0)):
        (tmp_path / "calib.json").write_text(json.dumps({**calibration, unit: value}))
        assert read_pair(tmp_path).baseline == pytest.approx(0.05)
    (tmp_path / "calib.json").write_text(json.dumps({**calibration, "baseline_m": "near"}))
    with pytest.raises(
        DigsError, match=r"calib\.json': baseline_m is 'near', expected metres above 0"
    ):
        read_pair(tmp_path)
    (tmp_path / "disp.npz").write_bytes(b"PK nothing")
    with pytest.raises(DigsError, match=r"disp\.npz': cannot be read"):
        read_pair(tmp_path)


def test_the_right_image_of_a_plane_is_what_the_right_eye_sees() -> None:
    rig = load_profile("zed2-720").rig(320, 200, 60)
    truth = photograph(Place(1.2, 18, -9), rig)
    made = right_image(truth.image, truth.disparity)
    seen = made[:, : 320 - 90].astype(float) - truth.right[:, : 320 - 90]
    assert np.sqrt((seen**2).mean()) < 2.5, "interpolation and rounding"
    wrong = right_image(truth.image, truth.disparity + 0.25)[:, : 320 - 90] - truth.right[
        :, : 320 - 90
    ].astype(float)
    assert np.sqrt((wrong**2).mean()) > 1.5 * np.sqrt((seen**2).mean()), (
        "a quarter of a pixel shows"
    )


def test_the_near_side_wins_and_what_only_the_right_eye_sees_is_taken_from_there() -> None:
    left = broadband((40, 120), 1)
    other = np.full_like(left, 7)
    disparity = np.full((40, 120), 5.0)
    disparity[:, 60:80] = 15.0
    made = right_image(left, disparity, unseen=other)
    np.testing.assert_array_equal(made[:, 45:65], left[:, 60:80])  # the near strip, moved by 15
    np.testing.assert_array_equal(made[:, 10:44], left[:, 15:49])
    assert (made[:, 65:75] == 7).all(), "uncovered beside it"
    assert (made[:, -5:] == 7).all(), "beyond the left image"


def test_unknown_disparity_is_taken_from_the_nearest_known() -> None:
    disparity = np.full((3, 6), np.nan)
    disparity[:, 0], disparity[:, 5] = 1.0, 2.0
    assert filled(disparity)[1].tolist() == [1, 1, 1, 2, 2, 2]


def test_scores_of_known_errors() -> None:
    rng = np.random.default_rng(0)
    true = np.full((120, 160), 10.0)
    found = true + 0.2 * rng.standard_normal(true.shape)
    found[:30] += 5.0
    found[60:63, 40:80] = np.nan
    everywhere = np.ones(true.shape, bool)
    values = scores(found, true, everywhere)
    inside = 120 * 150 + 30 * 0  # columns from 10 on are seen by both eyes
    assert values[BAD].value == pytest.approx(30 * 160 / (120 * 160 - 120), rel=1e-3)
    assert values[RMS].value == pytest.approx(0.2, rel=0.02)
    assert values["share without depth"].value == pytest.approx(120 / inside, rel=0.01)
    assert values["half of the hole area is in smaller holes [px]"].value == 120
    left = image_parts(true.shape)[LEFT]
    assert np.isnan(scores(found, true, left & (found > 1e9))[BAD].value)


def test_a_static_field_shows_beside_errors_that_both_have() -> None:
    rng = np.random.default_rng(0)
    field = unit_field(0, 480, 320)
    common = 0.2 * rng.standard_normal((320, 480))
    excess = excess_variance(common + 0.3 * field, common)
    of_field = excess_variance(field, np.zeros((320, 480)))
    sigma = np.sqrt(excess.value / of_field.value)
    assert sigma == pytest.approx(0.3, rel=0.15)


@pytest.mark.parametrize(("contrast", "known"), [(1 / 14, 3.0), (1 / 8, 6.0), (1 / 10, 1.5)])
def test_the_noise_of_a_pair_is_what_its_eyes_see_differently(
    contrast: float, known: float
) -> None:
    rig = load_profile("zed2-720").rig(400, 260, 60)
    truth = photograph(Place(1.2, 18, -9), rig)
    left = np.rint(128 + contrast * (truth.image.astype(float) - 128)).astype(np.uint8)
    right = right_image(left, truth.disparity)
    frame = known_frame(left, right, truth.disparity, replace(rig, image_noise=known))
    noisy = recorded_images(frame, ON_IMAGES, seed=5)
    found = eye_noise([Eyes(*noisy, truth.disparity)], rig.full_well)
    assert found.value == pytest.approx(known, rel=0.05)
    assert abs(found.value - known) < 3 * found.error < 0.3 * known
    assert not eye_noise([], rig.full_well).is_known


def test_grain_is_taken_out_and_texture_left() -> None:
    rng = np.random.default_rng(0)
    texture = broadband((120, 160), 2, 40.0).astype(float)
    plain = np.full((120, 160, 3), 128.0)
    for picture, kept in ((plain, 0.35), (texture, 1.0)):
        noisy = np.clip(np.rint(picture + 3 * rng.standard_normal(picture.shape)), 0, 255)
        clean = without_grain(noisy.astype(np.uint8), 3.0)
        assert (clean - picture).std() < kept * (noisy - picture).std()
    sharp = broadband((120, 160), 2, 40.0)
    assert (without_grain(sharp, 0.0) == sharp).all()


def test_half_of_motorcycle_predicts_the_other_half(sample_data: Path) -> None:
    """Wrong values of the half that was not fitted are within 20 % of the full search's, RMS within 15 %."""
    pair = read_pair(sample_data / "rgbd" / "middlebury_motorcycle")
    tries = try_noise(pair, load_profile("zed2-720").rig())
    parts = image_parts(pair.disparity.shape)
    for fitted, held_out in ((LEFT, RIGHT), (RIGHT, LEFT)):
        rig = with_figures(tries.rig, fit_part(tries, parts[fitted]))
        predicted = scores(tries.simulate(rig), pair.disparity, parts[held_out])
        real = scores(tries.measured, pair.disparity, parts[held_out])
        assert predicted[BAD].value == pytest.approx(real[BAD].value, rel=0.2)
        assert predicted[RMS].value == pytest.approx(real[RMS].value, rel=0.15)
        assert real[BAD].value > 0.05, "or there is nothing to predict"


def test_the_rig_of_a_pair_sees_all_of_it(sample_data: Path) -> None:
    pair = read_pair(sample_data / "rgbd" / "middlebury_motorcycle")
    rig = pair_rig(pair, load_profile("zed2-720").rig())
    assert rig.largest_disparity > np.nanmax(pair.disparity)
    assert rig.focal_baseline / rig.max_depth < np.nanmin(pair.disparity)
