"""Record a wall with known figures, fit, and find them again within the errors that the fit states."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.layers import Layer
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.config import Tier
from digs_warp.sim.fit.fit_wall import fit_wall
from digs_warp.sim.fit.known_frame import is_gray, sense_frame
from digs_warp.sim.fit.result import Fit
from digs_warp.sim.fit.wall import read_wall
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from reference.textured_wall import PLACES, in_memory, photograph, record_wall

SIZE = (384, 216)

# Standard errors within which a figure is found again.
WITHIN = 3.0

KNOWN = {"image_noise": 2.5, "full_well": 5_000.0, "static_field": 0.16}
DRIFT = Drift(yaw_deg=-0.04, baseline=-1e-2)


def base() -> StereoRig:
    return load_profile("bare-matcher").rig(*SIZE)


def fitted(tier: Tier, figures: dict[str, float], drift: Drift = NO_DRIFT) -> Fit:
    """Record with the figures, fit with a base that has others."""
    rig = replace(base(), unit=2, **figures)
    capture = record_wall(in_memory(rig), rig, tier, PLACES, 4, 1, drift)
    distances = [place.distance for place in PLACES]
    return fit_wall(read_wall(capture, rig.baseline), base(), distances)


def check(fit: Fit, known: dict[str, float], largest: dict[str, float]) -> None:
    """Compare the fitted figures with the known ones."""
    found = {figure.name: figure.estimate for figure in fit.figures}
    for name, value in known.items():
        miss = abs(found[name].value - value)
        assert miss <= WITHIN * found[name].error + 1e-9, (name, value, found[name])
        if name in largest:  # a large error would excuse anything
            assert found[name].error <= largest[name], (name, found[name])


def test_matched_depth_gives_back_noise_field_and_drift_and_is_simulated_again() -> None:
    """The profile alone, without the recorded right images or depths, gives the same statistics."""
    fit = fitted("guided", KNOWN, DRIFT)
    of_drift = {"rotation_drift": abs(DRIFT.yaw_deg), "baseline_drift": abs(DRIFT.baseline)}
    largest = {name: 0.1 * value for name, value in KNOWN.items()}
    check(fit, KNOWN | of_drift, largest | {"rotation_drift": 0.03, "baseline_drift": 5e-3})
    rows = {row.name: row for row in fit.comparisons}
    for name, tolerance in {
        "disparity noise of a frame [px]": 0.05,
        "of that, temporal [px]": 0.05,
        "of that, fixed [px]": 0.05,
        "of that, common to all distances [px]": 0.1,
        "rest to a plane in windows of 8 px [px]": 0.1,
        "rest to a plane in windows of 32 px [px]": 0.1,
        "noise of the images between frames [DN]": 0.02,
        "scale of the disparity": 0.005,
    }.items():
        row = rows[name]
        assert row.simulated.value == pytest.approx(row.measured.value, rel=tolerance), name
    offset = rows["offset of the disparity [px]"]
    assert offset.measured.value < -0.15, "or the sign shows nothing"
    assert offset.simulated.value == pytest.approx(offset.measured.value, abs=0.12)
    assert rows["share off the wall by more than a pixel"].measured.value < 0.01
    assert "disparity noise of a frame at 2.5" in " ".join(rows)


def test_an_infrared_pair_is_fitted_from_its_own_images() -> None:
    """Depth comes in the image of a color camera that stands elsewhere, sees less, and has other noise."""
    known = {"image_noise": 1.5, "full_well": 9_000.0, "static_field": 0.15}
    native = replace(load_profile("d435").rig(*SIZE), least_confidence=0.0, smoothing=0.0)
    rig = replace(native, color_offset=-0.02, color_zoom=1.3, color_noise=3.0, unit=1, **known)
    capture = record_wall(in_memory(rig), rig, "guided", PLACES[:4], 3, seed=0)
    wall = read_wall(capture, baseline=1.0)
    fit = fit_wall(wall, replace(native, color_offset=0.0, color_zoom=1.0))

    assert wall.intrinsics == rig.intrinsics and wall.is_gray
    for pose, place in zip(wall.poses, PLACES, strict=False):
        off = pose.plane.disparity(wall.shape) - photograph(place, rig).disparity
        assert np.abs(off).max() < 0.1
    check(
        fit,
        {
            **known,
            "color_noise": 3.0,
            "disparity_step": native.disparity_step,
        },
        {"image_noise": 0.03, "color_noise": 0.05, "static_field": 0.03, "disparity_step": 0.0},
    )
    found = {figure.name: figure.estimate.value for figure in fit.figures}
    assert found["color_offset"] == pytest.approx(-0.02)
    assert found["color_zoom"] == pytest.approx(1.3)
    rows = {row.name: row for row in fit.comparisons}
    temporal = rows["of that, temporal [px]"]
    assert temporal.simulated.value == pytest.approx(temporal.measured.value, rel=0.08)
    assert rows["share without depth"].measured.value < 1e-3, "the color camera sees less"
    assert {"min_depth", "max_depth", "baseline_drift"} <= set(fit.kept)


def test_noise_of_gray_eyes_is_one_value() -> None:
    """The brightness of three independent channels is less noisy: the root of .299^2 + .587^2 + .114^2."""
    rig = replace(base(), image_noise=3.0)
    wall = photograph(PLACES[2], rig)
    spread = {}
    for gray in (True, False):
        frames = [sense_frame(replace(wall, number=i), gray=gray) for i in range(4)]
        assert is_gray(np.stack([images for images, _ in frames])) == gray
        spread[gray] = float(np.sqrt(np.nanmean(np.var([s.disparity for _, s in frames], axis=0))))
    assert 1.3 < spread[True] / spread[False] < 1.7


def test_an_infrared_pair_without_its_images_is_named() -> None:
    rig = load_profile("d435").rig(*SIZE)
    capture = record_wall(in_memory(rig), rig, "law", PLACES[:1], frames=1)
    frames = tuple(frame.without_layer(Layer.INFRARED_RIGHT) for frame in capture.frames)
    with pytest.raises(DigsError, match="frame '0000': no right infrared image; expected both"):
        read_wall(replace(capture, frames=frames), rig.baseline)


def test_depth_by_the_law_gives_back_its_noise_steps_and_what_changes() -> None:
    """The field of the unit has no part in it: what stays is another at each distance."""
    known = {
        "disparity_sigma": 0.2,
        "disparity_correlation": 12.0,
        "temporal_share": 0.4,
        "disparity_step": 1 / 16,
    }
    found = {figure.name: figure.estimate.value for figure in fitted("law", known).figures}
    assert found["disparity_sigma"] == pytest.approx(0.2, rel=0.1)
    assert found["disparity_correlation"] == pytest.approx(12.0, rel=0.3)
    assert found["temporal_share"] == pytest.approx(0.4, abs=0.1)
    assert found["disparity_step"] == 1 / 16


def test_what_a_recording_cannot_tell_is_said_and_kept() -> None:
    """A camera that sees all of the wall, once from each of two places."""
    rig = replace(base(), static_field=0.1)
    capture = record_wall(in_memory(rig), rig, "guided", PLACES[1:3], frames=1)
    fit = fit_wall(read_wall(capture, rig.baseline), base())
    found = {figure.name for figure in fit.figures}
    unknown = {"min_depth", "max_depth", "rotation_drift", "full_well"}
    assert unknown <= set(fit.kept) and not unknown & found
    assert "static_field" in found and "several frames" in fit.kept["image_noise"]
    assert any("one frame at each distance" in doubt for doubt in fit.doubts)
    assert any("2 distances" in doubt for doubt in fit.doubts)
