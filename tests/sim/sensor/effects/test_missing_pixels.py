"""Effects that take pixels away, against closed forms and the measured tables."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.texture import LUMA_NOISE
from digs_warp.sim.sensor.tiers import depth_of, sense_effects
from reference.stereo_frames import broadband, flat, make_frame, make_rig

SHAPE = (240, 320)


def holes(truth: FrameTruth, name: str, strength: float = 1.0, seed: int = 0) -> np.ndarray:
    """Where the effect alone makes holes."""
    return ~sense_effects(truth, [name], seed, strength).known


def disc(radius: float, shape: tuple[int, int]) -> np.ndarray:
    """A mask of a centered disc."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.hypot(x - shape[1] / 2, y - shape[0] / 2) < radius


@pytest.mark.parametrize("disparity", [3.2, 17.0, 45.6, 127.7])
def test_band_is_as_wide_as_the_disparity(disparity: float) -> None:
    lost = holes(make_frame(disparity), "invalid-band")
    assert (lost.sum(axis=1) == round(disparity)).all()
    assert lost[:, : round(disparity)].all()


def test_band_follows_the_shape_of_what_lies_there() -> None:
    disparity = np.full(SHAPE, 10.0)
    disparity[100:140, :60] = 40.0
    lost = holes(make_frame(disparity), "invalid-band")
    assert (lost.sum(axis=1)[100:140] == 40).all()
    assert (lost.sum(axis=1)[:100] == 10).all()


def test_band_wider_than_the_image_leaves_nothing() -> None:
    assert holes(make_frame(600.0, make_rig(min_depth=0.01)), "invalid-band").all()


@pytest.mark.parametrize("name", ["invalid-band", "depth-range"])
def test_limits_stay_where_they_are_when_errors_grow(name: str) -> None:
    truth = make_frame(40.0, make_rig(max_disparity=95.0))
    np.testing.assert_array_equal(holes(truth, name, 4.0), holes(truth, name))


def test_range_is_coded_as_a_zed_does() -> None:
    rig = make_rig(min_depth=0.5, max_depth=5.0)
    depth = np.full(SHAPE, 1.0)
    depth[0], depth[1], depth[2], depth[3], depth[4] = 0.49, 5.01, 0.5, 5.0, np.nan
    truth = make_frame(rig.focal_baseline / depth, rig)
    sensed = sense_effects(truth, ["depth-range"])
    reported = depth_of(sensed, truth)
    assert (reported[0] == -np.inf).all() and (sensed.cause[0] == Cause.NEAR).all()
    assert (reported[1] == np.inf).all() and (sensed.cause[1] == Cause.FAR).all()
    np.testing.assert_array_equal(reported[2:4], truth.depth[2:4])
    assert np.isnan(reported[4]).all() and (sensed.cause[4] == Cause.OK).all()


def test_search_range_limits_the_nearest_depth() -> None:
    rig = make_rig(max_disparity=95.0)
    assert holes(make_frame(96.0, rig), "depth-range").all()
    assert not holes(make_frame(94.0, rig), "depth-range").any()


def test_disparity_that_vanishes_in_the_noise_is_too_far() -> None:
    truth = make_frame(2.6, make_rig(disparity_sigma=3.0))
    sensed = sense_effects(truth, ["correlated-noise", "depth-range"])
    far = sensed.cause == Cause.FAR
    assert far.any() and (depth_of(sensed, truth)[far] == np.inf).all()


@pytest.mark.parametrize("share", [0.023, 0.3])
def test_random_pixels_drop_independently_with_the_share_of_the_rig(share: float) -> None:
    lost = holes(make_frame(50.0, make_rig(640, 480, random_invalid=share)), "random-invalid")
    tolerance = 5 * np.sqrt(share * (1 - share) / lost.size)
    assert lost.mean() == pytest.approx(share, abs=tolerance)
    neighbours = np.mean(lost[:, 1:] & lost[:, :-1])
    assert neighbours == pytest.approx(share**2, abs=5 * share / np.sqrt(lost.size))


def test_random_share_of_one_leaves_nothing() -> None:
    assert holes(make_frame(50.0, make_rig(random_invalid=0.5)), "random-invalid", 2.0).all()


@pytest.mark.parametrize(("value", "cause"), [(255, Cause.EXPOSURE), (5, Cause.EXPOSURE)])
def test_saturated_and_black_windows_are_lost(value: int, cause: Cause) -> None:
    image = broadband(SHAPE)
    image[100:140, 100:180] = value
    truth = make_frame(50.0, make_rig(drops_saturated=True), image)
    sensed = sense_effects(truth, ["exposure"])
    expected = np.zeros(SHAPE, dtype=bool)
    expected[102:138, 102:178] = True  # windows of 5 px that lie wholly inside
    np.testing.assert_array_equal(~sensed.known, expected)
    assert (sensed.cause[expected] == cause).all()


def test_smoothness_fills_saturated_areas_of_other_rigs_from_the_rim() -> None:
    image = broadband(SHAPE)
    image[60:180, 60:260] = 255
    lost = holes(make_frame(50.0, make_rig(), image), "exposure")
    assert lost[120, 160] and not lost[75, 160] and not lost[120, 75]


def textureless(radius: float, slope: float = 0.0) -> tuple[float, float]:
    """Share of a plain disc that is lost, and that is wrong by a pixel and more; mean of 8 frames."""
    shape = (300, 300)
    inside = disc(radius, shape)
    image = broadband(shape)
    image[inside] = 128
    rig = make_rig(300, 300)
    lost = wrong = 0.0
    for number in range(8):
        truth = make_frame(60 + slope * np.arange(300.0)[None], rig, image, number)
        sensed = sense_effects(truth, ["textureless"])
        lost += float(np.mean(~sensed.known[inside])) / 8
        error = np.abs(sensed.disparity - truth.disparity)[inside]
        wrong += float(np.mean(error >= 0.999)) / 8
        assert sensed.known[~inside].all()
        assert (sensed.cause[sensed.disparity != truth.disparity] == Cause.TEXTURELESS).all()
    return lost, wrong


def test_textureless_discs_fail_as_measured() -> None:
    failed = {radius: sum(textureless(radius)) for radius in (20, 40, 80, 120)}
    assert failed[20] == 0
    # Semi-global matching: 6, 34 and 53 % of the area.
    measured = {40: 0.06, 80: 0.34, 120: 0.53}
    for radius, share in measured.items():
        assert failed[radius] == pytest.approx(share, abs=0.07)


def test_textureless_discs_fail_more_on_slopes() -> None:
    assert sum(textureless(40, 0.05)) == pytest.approx(0.37, abs=0.15)
    assert sum(textureless(80, 0.05)) == pytest.approx(0.74, abs=0.15)


def test_textureless_discs_leave_both_holes_and_wrong_depth() -> None:
    lost, wrong = textureless(120)
    assert lost > 0.05 and wrong > lost


def test_everything_fails_where_nothing_has_texture() -> None:
    truth = make_frame(50.0, image=flat(SHAPE))
    sensed = sense_effects(truth, ["textureless"])
    assert (sensed.cause == Cause.TEXTURELESS).all()


def uniform_snr(snr: float, shape: tuple[int, int] = (240, 320)) -> FrameTruth:
    """A plane whose texture has this gradient over image noise everywhere."""
    image = broadband(shape, contrast=30.0)
    # Tilted, so that the fraction of the disparity takes all values.
    truth = make_frame(np.linspace(40, 60, shape[1])[None], make_rig(shape[1], shape[0]), image)
    gradient = float(np.sqrt(np.mean(truth.gradient**2)))
    return replace(truth, rig=replace(truth.rig, image_noise=gradient / snr / LUMA_NOISE))


@pytest.mark.parametrize(("snr", "fill"), [(0.06, 0.003), (0.12, 0.09), (0.24, 0.9), (0.47, 1.0)])
def test_weak_texture_is_lost_as_measured(snr: float, fill: float) -> None:
    """Ideal synthetic pairs have 0.99 at 0.24; rendered frames lose strips there."""
    sensed = sense_effects(uniform_snr(snr), ["weak-texture"])
    assert sensed.known.mean() == pytest.approx(fill, abs=0.06)
    assert (sensed.cause[~sensed.known] == Cause.WEAK_TEXTURE).all()


@pytest.mark.parametrize(
    ("snr", "rms", "bad"),
    [(0.09, 0.52, 0.36), (0.18, 0.46, 0.17), (0.37, 0.38, 0.08), (0.75, 0.31, 0.05)],
)
def test_weak_texture_adds_the_noise_of_rendered_scenes(snr: float, rms: float, bad: float) -> None:
    truth = uniform_snr(1.0)
    typical = float(np.exp(np.median(truth.texture.typical(20))))
    truth = replace(
        truth, rig=replace(truth.rig, disparity_sigma=0.1, image_noise=typical / snr / LUMA_NOISE)
    )
    sensed = sense_effects(truth, ["weak-texture", "correlated-noise"])
    error = (sensed.disparity - truth.disparity)[sensed.known]
    inliers = error[np.abs(error) < 1]
    assert np.sqrt(np.mean(inliers**2)) == pytest.approx(rms, rel=0.2)
    assert np.mean(np.abs(error) > 1) == pytest.approx(bad, abs=0.05)


def test_weak_texture_fails_in_strips_along_the_rows_that_read_too_far() -> None:
    truth = uniform_snr(
        1.0
    )  # typical gradients are half of that: noise alone is rarely wrong there
    sensed = sense_effects(truth, ["weak-texture"])
    error = sensed.disparity - truth.disparity
    wrong = np.abs(error) > 1
    assert wrong.mean() == pytest.approx(0.08, abs=0.04)
    assert (error[wrong] < 0).mean() > 0.7
    centred = wrong - wrong.mean()
    along, across = (
        float(np.mean(a * b))
        for a, b in ((centred[:, :-16], centred[:, 16:]), (centred[:-16], centred[16:]))
    )
    assert along > 2 * max(across, 0.0) and along > 0.2 * float(np.mean(centred**2))


def test_weak_texture_labels_what_is_wrong() -> None:
    truth = uniform_snr(0.3)
    sensed = sense_effects(truth, ["weak-texture"])
    wrong = np.abs(sensed.disparity - truth.disparity) > 1.001
    assert wrong.any() and (sensed.cause[wrong] == Cause.WEAK_TEXTURE).all()
    right = np.abs(sensed.disparity - truth.disparity) < 0.999
    assert (sensed.cause[right] == Cause.OK).all()


def test_a_plain_patch_in_good_texture_is_not_called_weak() -> None:
    image = broadband(SHAPE)
    image[disc(20, SHAPE)] = 128
    assert not holes(make_frame(50.0, image=image), "weak-texture").any()


@pytest.mark.parametrize(
    ("slope", "fill"), [(0.35, 0.99), (0.40, 0.75), (0.45, 0.19), (0.50, 0.02), (-0.5, 1.0)]
)
def test_slanted_planes_are_lost_as_measured(slope: float, fill: float) -> None:
    rig = make_rig(max_depth=500.0)
    plane = 200 + slope * (np.arange(320.0)[None, :] - 160)
    kept = [~holes(make_frame(plane, rig, number=number), "grazing") for number in range(4)]
    assert np.mean(kept) == pytest.approx(fill, abs=0.05)


@pytest.mark.parametrize(("slope", "fill"), [(0.4, 1.0), (0.6, 0.82), (0.8, 0.07)])
def test_planes_slanted_along_columns_are_lost_as_measured(slope: float, fill: float) -> None:
    plane = 200 + slope * (np.arange(240.0)[:, None] - 120)
    lost = holes(make_frame(plane, make_rig(max_depth=500.0)), "grazing")
    assert 1 - lost.mean() == pytest.approx(fill, abs=0.07)


def test_narrow_grazing_strips_take_the_disparity_of_their_rim() -> None:
    columns = np.arange(320.0)
    disparity = np.full((240, 320), 30.0)
    disparity[:, 100:112] += 0.7 * (columns[100:112] - 99)  # 8 px up over 12 px
    disparity[:, 112:] += 0.7 * 12
    truth = make_frame(disparity)
    sensed = sense_effects(truth, ["grazing"])
    assert sensed.known.all()
    strip = sensed.disparity[:, 101:111]
    assert set(np.unique(strip.round(3))) <= {30.7, 38.4, *np.unique(truth.disparity.round(3))}
    assert (sensed.cause[sensed.disparity != truth.disparity] == Cause.GRAZING).all()
    assert np.mean(np.abs(sensed.disparity - truth.disparity)[:, 102:110] > 1) > 0.5


def test_wide_grazing_areas_are_filled_at_the_rim_and_lost_inside() -> None:
    disparity = np.full((240, 320), 30.0)
    disparity[:, 100:200] += 0.7 * np.arange(100)
    disparity[:, 200:] += 70
    known = sense_effects(make_frame(disparity), ["grazing"]).known
    assert known[:, 101:108].all() and not known[:, 115:185].any()


def test_the_rim_of_a_ball_does_not_take_the_disparity_of_the_wall() -> None:
    disparity = np.full((240, 320), 30.0)
    disparity[:, 100:110] = 100 - 0.7 * (10 - np.arange(10.0))
    disparity[:, 110:] = 100.0
    sensed = sense_effects(make_frame(disparity), ["grazing"])
    assert (sensed.disparity[:, 100:110][sensed.known[:, 100:110]] > 90).all()
    assert sensed.known[:, 104:].all()


def test_steps_are_not_grazing_surfaces() -> None:
    disparity = np.full(SHAPE, 20.0)
    disparity[60:180, 100:220] = 60.0
    assert not holes(make_frame(disparity), "grazing").any()


def test_holes_keep_their_first_cause() -> None:
    sensed = Sensed.of(make_frame(50.0))
    everywhere = np.ones(SHAPE, dtype=bool)
    twice = sensed.with_holes(everywhere, Cause.FAR).with_holes(everywhere, Cause.RANDOM)
    assert (twice.cause == Cause.FAR).all() and (twice.confidence == 0).all()
