"""Captures at rising noise: what differs between them, how they are kept, and the curve of an error."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.testing.curve import DegradationCurve
from digs_warp.sim.testing.series import CaptureCache, NoiseSeries
from digs_warp.sim.testing.sources import SimulatedWalk
from reference.file_hashes import file_hashes
from reference.mesh_files import under_gray_sky

BOX = Path(__file__).parent / "box.obj"

TETRAHEDRON = "v 0 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1 1\nf 1 2 3\nf 2 3 4\nf 1 3 4\nf 1 2 4\n"


def depth_error(capture: Capture) -> float:
    """RMS error of the sensed depth on the object, in units of squared depth."""
    errors = []
    for frame in capture.frames:
        true, sensed = frame.load_depth_true(), frame.load_depth()
        known = (frame.load_mask() == 255) & np.isfinite(sensed)
        errors.append(((sensed - true) / true**2)[known])
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


@pytest.mark.sensor_noise(mesh=BOX, object_size=0.5, tier="law", strengths=(0, 1, 4), frames=3)
def test_depth_errors_follow_the_noise(sensor_noise: NoiseSeries) -> None:
    curve = sensor_noise.measure(depth_error)
    assert curve.errors[0] == 0.0
    # sigma_Z = Z^2 sigma_d / (f b): linear in the noise.
    assert [growth for *_, growth in curve.growth()] == pytest.approx([1.0], abs=0.1)
    curve.assert_no_cliff(largest_growth=1.1)


# The cache


def kept(captures: CaptureCache, config: SimulateConfig) -> Capture:
    """The capture of these settings."""
    return captures.capture(SimulatedWalk(config), config.strength)


@pytest.fixture
def config(tmp_path: Path) -> SimulateConfig:
    return under_gray_sky(tmp_path, TETRAHEDRON, width=24, height=16)


def test_a_series_loads_its_scene_once_and_the_captures_are_those_of_their_own(
    config: SimulateConfig, tmp_path: Path
) -> None:
    series = NoiseSeries(SimulatedWalk(config), (0.5, 2.0), CaptureCache(tmp_path / "series"))
    first = series.capture(0.5)
    assert config.mesh is not None
    config.mesh.unlink()  # is not read again
    second = series.capture(2.0)
    config.mesh.write_text(TETRAHEDRON)
    for shared, strength in ((first, 0.5), (second, 2.0)):
        alone = kept(CaptureCache(tmp_path / "alone"), replace(config, strength=strength))
        assert file_hashes(shared.folder) == file_hashes(alone.folder)


def test_whatever_decides_the_bytes_decides_the_name(
    config: SimulateConfig, tmp_path: Path
) -> None:
    captures = CaptureCache(tmp_path / "cache")
    first = kept(captures, config).folder
    (first / "mark").touch()
    assert (kept(captures, config).folder / "mark").exists()  # it is simulated once
    names = {first.name}
    names.add(kept(captures, replace(config, seed=1)).folder.name)
    names.add(kept(captures, replace(config, strength=2.0)).folder.name)
    assert config.mesh is not None
    config.mesh.write_text(TETRAHEDRON.replace("v 0 1 1", "v 0 2 1"))
    names.add(kept(captures, config).folder.name)
    assert len(names) == 4
    assert {path.name for path in captures.folder.glob("*/*")} == names


def test_captures_of_other_code_are_removed(
    config: SimulateConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    captures = CaptureCache(tmp_path / "cache")
    before = kept(captures, config).folder
    monkeypatch.setattr("digs_warp.sim.testing.series._code_key", lambda: "other code")
    after = kept(captures, config).folder
    assert (before.name, before.exists()) == (after.name, False)
    assert [path.name for path in captures.folder.iterdir()] == ["other code"]


def test_a_failed_simulation_leaves_nothing_behind(config: SimulateConfig, tmp_path: Path) -> None:
    captures = CaptureCache(tmp_path / "cache")
    with pytest.raises(DigsError, match="no such file"):
        kept(captures, replace(config, mesh=tmp_path / "missing.obj"))
    assert [path for path in tmp_path.glob("cache/**/*") if path.is_file()] == []


def test_a_failing_function_tells_the_strength(config: SimulateConfig, tmp_path: Path) -> None:
    series = NoiseSeries(SimulatedWalk(config), (0, 3), CaptureCache(tmp_path / "cache"))

    def fails_on_noise(capture: Capture) -> float:
        frame = capture.frames[0]
        assert np.array_equal(frame.load_depth(), frame.load_depth_true(), equal_nan=True)
        return 0.0

    with pytest.raises(AssertionError) as caught:
        series.measure(fails_on_noise)
    assert caught.value.__notes__ == ["on the capture at sensor noise strength 3"]
    with pytest.raises(DigsError, match="the function returned None, expected one number"):
        series.measure(lambda capture: None)  # pyright: ignore[reportArgumentType]
    for strengths in ((), (1, 1), (2, 1), (-1, 2)):
        with pytest.raises(DigsError, match="expected rising numbers"):
            NoiseSeries(SimulatedWalk(config), strengths, CaptureCache(tmp_path))


def test_growth_is_the_slope_between_logarithms() -> None:
    curve = DegradationCurve((0, 1, 2, 8), (0.0, 3.0, 12.0, 12.0))
    assert curve.growth() == [(1, 2, pytest.approx(2.0)), (2, 8, 0.0)]


def test_a_cliff_is_found_and_shown() -> None:
    curve = DegradationCurve((0, 1, 2, 4), (0.001, 0.01, 0.02, 0.64))
    curve.assert_no_cliff(largest_growth=5.0)
    with pytest.raises(AssertionError) as caught:
        curve.assert_no_cliff()
    message = str(caught.value)
    assert "from strength 2 to 4 it grows with exponent 5.00 (limit 2)" in message
    assert "       4         0.64 " + "#" * 40 in message


def test_an_error_that_starts_from_nothing_is_a_cliff() -> None:
    with pytest.raises(AssertionError, match="exponent inf"):
        DegradationCurve((1, 2), (0.0, 0.1)).assert_no_cliff()
    DegradationCurve((1, 2), (0.0, 0.0)).assert_no_cliff()


def test_an_error_that_appears_with_the_first_noise_and_stays_is_a_cliff() -> None:
    jump = DegradationCurve((0, 1, 2, 4), (0.001, 10.0, 10.1, 10.2))
    with pytest.raises(AssertionError, match=r"jumps from strength 0 to 1; .* exponent 0\.01"):
        jump.assert_no_cliff()
    jump.assert_no_cliff(smallest_growth=0)
    with pytest.raises(AssertionError, match="jumps from strength 0"):
        DegradationCurve((0, 1, 2), (0.0, 1.0, 1.0)).assert_no_cliff()
    DegradationCurve(
        (0, 1, 4), (0.0, 1.0, 2.0)
    ).assert_no_cliff()  # a square root is slow, but grows
    DegradationCurve((0, 1, 4), (1.0, 1.1, 1.1)).assert_no_cliff()  # hardly touched by noise


def test_an_error_that_falls_with_rising_noise_is_refused() -> None:
    falls = ((0.0, 1.0, 2.0, 0.1), (4.0, 1.0, 1.5, 3.0), (1.0, 0.9, 0.6, 0.4))
    for errors in (*falls, (0.001, 0.01, 0.002, 0.02)):  # the last one comes back steeply
        with pytest.raises(AssertionError, match="falls while the noise rises"):
            DegradationCurve((0, 1, 2, 4), errors).assert_no_cliff()
    DegradationCurve((0, 1, 2, 4), (1.0, 0.9, 1.1, 0.8)).assert_no_cliff()  # by chance


def test_a_curve_without_growth_or_numbers_proves_nothing() -> None:
    for strengths in ((0,), (0, 1), (1,)):
        with pytest.raises(DigsError, match="expected two above 0"):
            DegradationCurve(strengths, tuple(range(len(strengths)))).assert_no_cliff()
    for broken in (math.nan, math.inf):
        curve = DegradationCurve((0, 1, 2), (0.0, broken, 0.1))
        with pytest.raises(AssertionError, match="no numbers"):
            curve.assert_no_cliff()
        with pytest.raises(AssertionError, match="is no number at noise strength 1 "):
            curve.assert_at_most({1: 5.0})


def test_limits_hold_at_the_strengths_they_name() -> None:
    curve = DegradationCurve((0, 1, 2), (0.0, 0.1, 0.5))
    curve.assert_at_most({0: 0.0, 1: 0.1})
    with pytest.raises(AssertionError, match=r"at noise strength 2 \(limit 0.4\)"):
        curve.assert_at_most({1: 0.1, 2: 0.4})
    with pytest.raises(DigsError, match="strength 3 was not measured, expected some of"):
        curve.assert_at_most({3: 1.0})
