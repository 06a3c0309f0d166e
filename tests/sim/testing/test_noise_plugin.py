"""The pytest plug-in for sensor-noise robustness, used as another project would use it."""

import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.testing import each
from digs_warp.sim.testing.curve import DegradationCurve
from digs_warp.sim.testing.plugin import read_marker
from digs_warp.sim.testing.series import CaptureCache, NoiseSeries
from reference.file_hashes import file_hashes

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


def initialization_error(capture: Capture) -> float:
    """Mean distance [m] of the initial points to those of perfect depth."""
    from scipy.spatial import KDTree

    perfect = [
        frame.with_layer(Layer.DEPTH, frame.path(Layer.DEPTH_TRUE)) for frame in capture.frames
    ]
    surface = initial_points(perfect, InitConfig()).points_world
    points = initial_points(capture.frames, InitConfig()).points_world
    return float(KDTree(surface).query(points)[0].mean())


@pytest.mark.sensor_noise(mesh=BOX, object_size=0.5, tier="law", strengths=(0, 1, 4), frames=3)
def test_depth_errors_follow_the_noise(sensor_noise: NoiseSeries) -> None:
    curve = sensor_noise.measure(depth_error)
    assert curve.errors[0] == 0.0
    # sigma_Z = Z^2 sigma_d / (f b): linear in the noise.
    assert [growth for *_, growth in curve.growth()] == pytest.approx([1.0], abs=0.1)
    curve.assert_no_cliff(largest_growth=1.1)


@pytest.mark.sensor_noise(mesh=BOX, object_size=0.5, tier="law", strengths=(0, 1, 4), frames=3)
def test_initial_points_survive_sensor_noise(sensor_noise: NoiseSeries) -> None:
    curve = sensor_noise.measure(initialization_error)
    curve.assert_at_most({0: 1e-6, 1: 0.01})
    curve.assert_no_cliff()


@pytest.mark.sensor_noise(mesh=BOX, object_size=0.5, tier="law", strengths=(0, 4), frames=3)
def test_only_the_depth_differs_between_strengths(sensor_noise: NoiseSeries) -> None:
    (_, perfect), (_, noisy) = sensor_noise
    before, after = file_hashes(perfect.folder), file_hashes(noisy.folder)
    assert before.keys() == after.keys()
    different = {path.split("/")[0] for path in before if before[path] != after[path]}
    assert different - {"transforms.json"} == {"depth"}


@pytest.mark.sensor_noise(
    mesh=BOX,
    object_size=0.5,
    effects=("static-field", "quantum"),
    strengths=(0, 1, 3),
    frames=2,
)
def test_named_effects_act_alone(sensor_noise: NoiseSeries) -> None:
    (_, perfect), (_, usual), (_, worse) = sensor_noise
    for before, once, thrice in zip(perfect.frames, usual.frames, worse.frames, strict=True):
        np.testing.assert_array_equal(before.load_depth(), before.load_depth_true())
        for after in (once, thrice):
            np.testing.assert_array_equal(before.load_image(), after.load_image())
        # The same images, the same failures.
        first, second = (np.isfinite(after.load_depth()) for after in (once, thrice))
        assert (first != second).mean() < 1e-3  # the band moves with the field


# The cache


@pytest.fixture
def config(tmp_path: Path) -> SimulateConfig:
    mesh, sky = tmp_path / "thing.obj", tmp_path / "sky.png"
    mesh.write_text(TETRAHEDRON)
    write_image(sky, np.full((8, 16, 3), 200, np.uint8))
    return SimulateConfig(
        mesh=mesh, environment=sky, frames=1, width=24, height=16, samples_per_pixel=1
    )


def test_a_capture_is_simulated_once(config: SimulateConfig, tmp_path: Path) -> None:
    captures = CaptureCache(tmp_path / "cache")
    first = captures.capture(config)
    (first.folder / "mark").touch()
    assert (captures.capture(config).folder / "mark").exists()


def test_a_series_loads_its_scene_once_and_the_captures_are_those_of_their_own(
    config: SimulateConfig, tmp_path: Path
) -> None:
    series = NoiseSeries(config, (0.5, 2.0), CaptureCache(tmp_path / "series"))
    first = series.capture(0.5)
    assert config.mesh is not None
    config.mesh.unlink()  # is not read again
    second = series.capture(2.0)
    config.mesh.write_text(TETRAHEDRON)
    for shared, strength in ((first, 0.5), (second, 2.0)):
        alone = CaptureCache(tmp_path / "alone").capture(replace(config, strength=strength))
        assert file_hashes(shared.folder) == file_hashes(alone.folder)


def test_whatever_decides_the_bytes_decides_the_name(
    config: SimulateConfig, tmp_path: Path
) -> None:
    captures = CaptureCache(tmp_path / "cache")
    names = {captures.capture(config).folder.name}
    names.add(captures.capture(replace(config, seed=1)).folder.name)
    names.add(captures.capture(replace(config, strength=2.0)).folder.name)
    assert config.mesh is not None
    config.mesh.write_text(TETRAHEDRON.replace("v 0 1 1", "v 0 2 1"))
    names.add(captures.capture(config).folder.name)
    assert len(names) == 4
    assert {path.name for path in captures.folder.glob("*/*")} == names


def test_captures_of_other_code_are_removed(
    config: SimulateConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    captures = CaptureCache(tmp_path / "cache")
    before = captures.capture(config).folder
    monkeypatch.setattr("digs_warp.sim.testing.series._code_key", lambda: "other code")
    after = captures.capture(config).folder
    assert (before.name, before.exists()) == (after.name, False)
    assert [path.name for path in captures.folder.iterdir()] == ["other code"]


def test_a_failed_simulation_leaves_nothing_behind(config: SimulateConfig, tmp_path: Path) -> None:
    captures = CaptureCache(tmp_path / "cache")
    with pytest.raises(DigsError, match="no such file"):
        captures.capture(replace(config, mesh=tmp_path / "missing.obj"))
    assert [path for path in tmp_path.glob("cache/**/*") if path.is_file()] == []


def test_a_failing_function_tells_the_strength(config: SimulateConfig, tmp_path: Path) -> None:
    series = NoiseSeries(config, (0, 3), CaptureCache(tmp_path / "cache"))

    def fails_on_noise(capture: Capture) -> float:
        frame = capture.frames[0]
        assert np.array_equal(frame.load_depth(), frame.load_depth_true(), equal_nan=True)
        return 0.0

    with pytest.raises(AssertionError) as caught:
        series.measure(fails_on_noise)
    assert caught.value.__notes__ == ["on the simulated capture at sensor noise strength 3"]


@pytest.mark.parametrize("strengths", [(), (1, 1), (2, 1), (-1, 2)])
def test_strengths_have_to_rise(
    strengths: tuple[float, ...], config: SimulateConfig, tmp_path: Path
) -> None:
    with pytest.raises(DigsError, match="expected rising numbers"):
        NoiseSeries(config, strengths, CaptureCache(tmp_path))


# The curve


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
    for errors in ((0.0, 1.0, 2.0, 0.1), (4.0, 1.0, 1.5, 3.0), (1.0, 0.9, 0.6, 0.4)):
        with pytest.raises(AssertionError, match="falls while the noise rises"):
            DegradationCurve((0, 1, 2, 4), errors).assert_no_cliff()
    DegradationCurve((0, 1, 2, 4), (1.0, 0.9, 1.1, 0.8)).assert_no_cliff()  # by chance


@pytest.mark.parametrize("strengths", [(0,), (0, 1), (1,)])
def test_a_curve_that_shows_no_growth_proves_nothing(strengths: tuple[float, ...]) -> None:
    with pytest.raises(DigsError, match="expected two above 0"):
        DegradationCurve(strengths, tuple(range(len(strengths)))).assert_no_cliff()


@pytest.mark.parametrize("broken", [math.nan, math.inf])
def test_errors_that_are_no_numbers_never_pass(broken: float) -> None:
    curve = DegradationCurve((0, 1, 2), (0.0, broken, 0.1))
    with pytest.raises(AssertionError, match="no numbers"):
        curve.assert_no_cliff()
    with pytest.raises(AssertionError, match="at noise strength 1 "):
        curve.assert_at_most({1: 5.0})


def test_limits_hold_at_the_strengths_they_name() -> None:
    curve = DegradationCurve((0, 1, 2), (0.0, 0.1, 0.5))
    curve.assert_at_most({0: 0.0, 1: 0.1})
    with pytest.raises(AssertionError, match=r"at noise strength 2 \(limit 0.4\)"):
        curve.assert_at_most({1: 0.1, 2: 0.4})
    with pytest.raises(KeyError):
        curve.assert_at_most({3: 1.0})


# In another project


def run_pytest(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run pytest in a fresh process, in a folder that knows nothing of this repository."""
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:dash", "--strict-markers", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_worked_example_passes_in_another_project(tmp_path: Path) -> None:
    page = Path(__file__).resolve().parents[3] / "docs/sensor-noise-plugin.md"
    example = page.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    (tmp_path / "test_example.py").write_text(example)
    done = run_pytest(tmp_path, "-q")
    assert done.returncode == 0, done.stdout + done.stderr
    assert list(tmp_path.glob(".pytest_cache/d/sensor_noise/*/*/transforms.json"))


EACH = """
import pytest
from digs_warp.sim.testing import each

@pytest.mark.sensor_noise(
    effects=each("shot-noise", "static-field"), strengths=(0, 1, 4), frames=1, width=48, height=36
)
def test_effects(sensor_noise, request):
    curve = sensor_noise.measure(noise)
    assert "static" not in request.node.name, "<planned>"

def noise(capture):
    return len(capture)
"""


@pytest.mark.parametrize("processes", [(), ("--numprocesses", "2")])
def test_each_effect_is_a_test_of_its_own_and_the_page_has_its_curve(
    processes: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "test_each.py").write_text(EACH)
    page = tmp_path / "noise.html"
    done = run_pytest(tmp_path, "-q", "--sensor-noise-report", str(page), *processes)
    assert "1 failed, 1 passed" in done.stdout, done.stdout + done.stderr
    assert "test_each.py::test_effects[static-field]" in done.stdout
    text = page.read_text()
    assert "test_each.py::test_effects[shot-noise]: noise" in text
    assert text.count("<table>") == 2
    assert text.count('class="failed"') == text.count('class="passed"') == 1
    assert "https://" not in text and "<script" not in text


def test_each_names_effects_that_exist() -> None:
    marker = pytest.mark.sensor_noise(effects=each("shot-noise", "shot-nose")).mark
    with pytest.raises(DigsError, match="shot-nose"):
        read_marker(marker)
    (config, _) = read_marker(
        pytest.mark.sensor_noise(effects=each("shot-noise")).mark, "shot-noise"
    )
    assert config.effects == "shot-noise"


def test_without_measurements_the_page_says_so(tmp_path: Path) -> None:
    (tmp_path / "test_nothing.py").write_text("def test_nothing(): pass")
    run_pytest(tmp_path, "--sensor-noise-report", str(tmp_path / "noise.html"))
    assert "0 curves" in (tmp_path / "noise.html").read_text()


def test_the_marker_is_described(tmp_path: Path) -> None:
    assert "sensor_noise(effects='auto'" in run_pytest(tmp_path, "--markers").stdout


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ("strenghts=(0, 1)", "no setting 'strenghts'; did you mean 'strengths'?"),
        ("'law'", "found ('law',), expected keyword arguments only"),
        ("effects='miror'", "no effect 'miror'; did you mean 'mirror'?"),
        ("effects=('mirror', 'quantm')", "no effect 'quantm'; did you mean 'quantum'?"),
        ("frames=0", "--frames: 0, expected 1 to 100,000"),
        ("strengths=(2, 1)", "expected rising numbers"),
        ("strengths='auto'", "expected finite numbers"),
    ],
)
def test_a_wrong_marker_stops_the_collection_in_one_line(arguments: str, reason: str) -> None:
    marker = eval(f"pytest.mark.sensor_noise({arguments})").mark
    with pytest.raises(DigsError, match=re.escape(reason)):
        read_marker(marker)


def test_a_misspelled_effect_is_told_before_any_test_runs(tmp_path: Path) -> None:
    (tmp_path / "test_wrong.py").write_text(
        "import pytest\n"
        "def test_before(): open('ran', 'w')\n"
        "@pytest.mark.sensor_noise(effects='miror')\n"
        "def test_mirror(sensor_noise): pass\n"
    )
    done = run_pytest(tmp_path)
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    (line,) = (line for line in (done.stdout + done.stderr).splitlines() if "miror" in line)
    assert line.startswith("ERROR: test_wrong.py::test_mirror: ") and "'mirror'?" in line
    assert not (tmp_path / "ran").exists()
    assert run_pytest(tmp_path, "-k", "before").returncode == 0
