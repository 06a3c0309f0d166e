"""A recording of one's own as source of the plug-in's captures."""

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.about import About
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.rig import InfraredPair, Rig
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.testing import each
from digs_warp.sim.testing.marker import read_marker
from digs_warp.sim.testing.series import CaptureCache, NoiseSeries
from digs_warp.sim.testing.sources import WorseRecording
from reference.file_hashes import file_hashes

K = Intrinsics(64, 48, 60.0, 60.0, 32.0, 24.0)
PAIR = Rig(0.05)
ALONE = "disparity-noise"


def record(folder: Path, rig: Rig | None = PAIR, frames: int = 2, **layers: Any) -> Path:
    """Write a recording of a wall 1 m away, with a hole and a mask; ``layers`` replace or add images."""
    writer = CaptureWriter(folder, K, rig)
    depth = np.full((48, 64), 1.0, np.float32)
    depth[:8] = np.nan
    image = np.full((48, 64, 3), 118, np.uint8)
    mask = np.full((48, 64), 255, np.uint8)
    for number in range(frames):
        images = {"image": image, "depth": depth, "mask": mask, **layers}
        writer.write_frame(number, FrameImages(**images))
        writer.add_pose(number, np.eye(4), 0.1 * number, color_gain=(1.0, 2.0, 3.0))
    writer.finish(About(recorded_as="tum", poses_known=False))
    return folder


def source_of(folder: Path, **settings: Any) -> WorseRecording:
    """What a marker makes of a recording."""
    source, _ = read_marker(pytest.mark.sensor_noise(capture=folder, **settings).mark)
    assert isinstance(source, WorseRecording)
    return source


def captures_of(folder: Path, cache: Path, **settings: Any) -> NoiseSeries:
    """The captures of a recording at strengths 0, 1 and 2."""
    return NoiseSeries(source_of(folder, **settings), (0, 1, 2), CaptureCache(cache))


def white(folder: Path, base: str) -> Path:
    """A profile whose noise is white and changes in every frame: small images have all of its variance."""
    path = folder / f"white-{base}.yaml"
    figures = {"disparity_correlation": 0.0, "temporal_share": 1.0}
    lines = [f"  {name}: {{value: {value}, origin: tuned}}" for name, value in figures.items()]
    path.write_text("\n".join([f"base: {base}", "figures:", *lines]))
    return path


def noise_of(capture: Capture) -> float:
    """Standard deviation of the depth errors in the first frame [m]."""
    frame = capture.frames[0]
    return float(np.nanstd(frame.load_depth() - frame.load_depth_true()))


def test_strength_zero_is_the_recording_and_noise_grows_on_it(tmp_path: Path) -> None:
    own = read_capture(record(tmp_path / "own"))
    profile = white(tmp_path, "zed2-720")
    series = captures_of(own.folder, tmp_path / "cache", profile=profile, effects=ALONE)
    (_, as_it_is), (_, usual), (_, worse) = series
    for before, after in zip(own.frames, as_it_is.frames, strict=True):
        np.testing.assert_array_equal(before.load_depth(), after.load_depth())
        np.testing.assert_array_equal(before.load_image(), after.load_image())
    for capture in (as_it_is, usual, worse):
        frame = capture.frames[1]
        np.testing.assert_array_equal(frame.load_depth_true(), own.frames[1].load_depth())
        assert np.isnan(frame.load_depth()[:8]).all()
        assert (frame.load_mask() == 255).all()
        assert (frame.time, frame.color_gain) == (0.1, (1.0, 2.0, 3.0))
        assert (capture.rig, capture.knows_poses) == (PAIR, False)
    # sigma_Z = Z^2 sigma_d / (f b); 0.1 px in this profile, the baseline is that of the recording.
    assert noise_of(usual) == pytest.approx(0.1 / (60.0 * 0.05), rel=0.1)
    assert series.measure(noise_of).errors[2] == pytest.approx(2 * noise_of(usual), rel=0.1)


def test_all_that_works_on_recordings_acts_unless_effects_are_named(tmp_path: Path) -> None:
    right = np.full((48, 64, 3), 90, np.uint8)
    trust = np.full((48, 64), 200, np.uint8)
    stepped = np.full((48, 64), 1.0, np.float32)
    stepped[:, 32:] = 0.5
    folder = record(tmp_path / "own", right=right, confidence=trust, depth=stepped)
    frame = captures_of(folder, tmp_path / "cache").capture(1).frames[0]
    for image, gray in ((frame.load_image(), 118), (frame.load_right_image(), 90)):
        assert 1.0 < np.std(image[20:28, 20:44].astype(float)) < 4.0
        assert abs(np.mean(image[20:28, 20:44]) - gray) < 6
    lost = np.isnan(frame.load_depth())
    assert lost[:, 30:34].all()
    confidence = frame.load_confidence()
    assert (confidence[lost] == 0).all()
    assert (confidence[~lost] == np.float32(200 / 255)).all()


def test_depth_of_an_infrared_pair_errs_by_the_focal_length_of_the_pair(tmp_path: Path) -> None:
    gray = np.full((48, 64), 118, np.uint8)
    pair = Rig(0.05, InfraredPair(-0.015, 30.0, 30.0, 32.0, 24.0))
    folder = record(tmp_path / "own", pair, infrared_left=gray, infrared_right=gray)
    noise = ("shot-noise", "read-noise")
    series = captures_of(folder, tmp_path / "cache", profile="d435", effects=noise)
    frame = series.capture(2).frames[0]
    for eye in frame.load_infrared():
        assert (
            0.3 < np.std(eye[20:28, 20:44].astype(float)) < 1.0
        )  # 0.25 DN in this profile, and steps
        for channel in np.moveaxis(frame.load_image(), -1, 0):
            assert abs(np.corrcoef(eye.ravel(), channel.ravel())[0, 1]) < 0.1
    profile = white(tmp_path, "d435")
    alone = captures_of(folder, tmp_path / "cache", profile=profile, effects=ALONE)
    assert noise_of(alone.capture(1)) == pytest.approx(0.13 / (30.0 * 0.05), rel=0.1)
    # Only the profile tells it here: the color camera of a D435 has 1.444 times the eyes' focal length.
    unknown = record(tmp_path / "unknown", rig=None)
    told = captures_of(unknown, tmp_path / "cache", profile=profile, effects=ALONE)
    assert noise_of(told.capture(1)) == pytest.approx(0.13 / (60.0 / 1.444 * 0.05), rel=0.1)


def test_a_simulated_capture_tells_its_camera_itself(tmp_path: Path) -> None:
    folder = record(tmp_path / "own")
    own = read_capture(folder)
    writer = CaptureWriter(folder, K, own.rig)
    for number, frame in enumerate(own.frames):
        writer.add_pose(number, frame.camera.world_from_cam, frame.time)
    sensor = {"disparity_sigma": 0.3, "max_depth": None, "drift": {}}
    writer.finish(About(sensor=sensor))
    figures = source_of(folder).recording.figures
    assert (figures.disparity_sigma, figures.baseline) == (0.3, 0.05)
    assert source_of(folder, profile="d435").recording.figures.disparity_sigma == 0.13


def test_captures_are_kept_until_the_recording_or_a_setting_changes(tmp_path: Path) -> None:
    folder, cache = record(tmp_path / "own"), tmp_path / "cache"
    first = captures_of(folder, cache).capture(1)
    (first.folder / "mark").touch()
    elsewhere = shutil.copytree(folder, tmp_path / "elsewhere")
    assert (captures_of(elsewhere, cache).capture(1).folder / "mark").exists()
    before = file_hashes(first.folder)
    names = {
        captures_of(folder, cache, **settings).capture(1).folder.name
        for settings in ({}, {"seed": 1}, {"effects": ALONE}, {"profile": "oak-d"})
    }
    record(folder, depth=np.full((48, 64), 1.5, np.float32))
    names.add(captures_of(folder, cache).capture(1).folder.name)
    assert len(names) == 5
    again = captures_of(elsewhere, tmp_path / "other").capture(1)
    assert {k: v for k, v in before.items() if k != "mark"} == file_hashes(again.folder)


def test_a_long_recording_is_thinned_evenly(tmp_path: Path) -> None:
    folder, cache = record(tmp_path / "own", frames=5), tmp_path / "cache"
    thin = captures_of(folder, cache, frames=3).capture(0)
    assert [frame.time for frame in thin.frames] == [
        read_capture(folder).frames[number].time for number in (0, 1, 3)
    ]
    assert len(captures_of(folder, cache).capture(0)) == 5
    assert len(captures_of(folder, cache, frames=9).capture(0)) == 5


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"effects": "mirror"}, "'mirror' needs a simulated scene"),
    ({"effects": "image-blur,quantum"}, "'image-blur' needs a simulated scene"),
    ({"effects": each("auto-exposure")}, "'auto-exposure' needs a simulated scene"),
    ({"effects": "disparity-nose"}, "did you mean 'disparity-noise'?"),
    ({"effects": "none"}, "nothing would change the recording"),
    ({"frames": 0}, "--frames: 0"),
    ({"mesh": "box.obj"}, "'mesh' is a setting of simulated recordings"),
    ({"tier": "law"}, "'tier' is a setting of simulated recordings"),
    ({"profil": "d435"}, "no setting 'profil'; did you mean 'profile'?"),
    ({"profile": "d434"}, "profile 'd434': not known; did you mean 'd435'?"),
    ({"seed": -1}, "--seed: -1"),
]


def test_a_setting_that_does_not_fit_is_told_before_any_test(tmp_path: Path) -> None:
    folder = record(tmp_path / "own", frames=1)
    for settings, reason in WRONG:
        with pytest.raises(DigsError, match=re.escape(reason)):
            source_of(folder, **settings)


def test_a_recording_that_cannot_be_used_is_told_before_any_test(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=r"missing.*(no such|not found|does not exist)"):
        source_of(tmp_path / "missing")
    with pytest.raises(DigsError, match="no frame has depth"):
        source_of(record(tmp_path / "flat", frames=1, depth=None))
    with pytest.raises(DigsError, match=r"expected a profile of its camera: profile='d435'"):
        source_of(record(tmp_path / "unknown", rig=None, frames=1))
    with pytest.raises(DigsError, match=r"no setting 'captur'; did you mean 'capture'"):
        read_marker(pytest.mark.sensor_noise(captur=tmp_path).mark)
