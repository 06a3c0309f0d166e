"""The pytest plug-in for sensor-noise robustness, used as another project would use it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.testing.marker import each, read_marker


def run_pytest(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run pytest in a fresh process, in a folder that knows nothing of this repository."""
    return subprocess.run(
        [sys.executable, "-m", "pytest", "--strict-markers", *arguments],
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


EACH = f"""
import pytest
from digs_warp.sim.testing import each

SMALL = dict(mesh={str(Path(__file__).with_name("box.obj"))!r}, ground="none", frames=1, width=48, height=36)

@pytest.mark.sensor_noise(effects=each("shot-noise", "static-field"), strengths=(0, 1, 4), **SMALL)
def test_effects(sensor_noise, request):
    curve = sensor_noise.measure(noise)
    assert "static" not in request.node.name, "<planned>"

@pytest.mark.sensor_noise(strengths=(0, 1, 4), **SMALL)
def test_broken(sensor_noise):
    sensor_noise.measure(lambda capture: 1 / 0)

def noise(capture):
    return len(capture)
"""


def test_each_effect_is_a_test_of_its_own_whose_curve_is_reported(tmp_path: Path) -> None:
    (tmp_path / "test_each.py").write_text(EACH)
    done = run_pytest(tmp_path, "-q", "--junit-xml", "junit.xml")
    assert "2 failed, 1 passed" in done.stdout, done.stdout + done.stderr
    assert "test_each.py::test_effects[static-field]" in done.stdout
    assert "series.py" not in done.stdout and "ZeroDivisionError" in done.stdout
    assert (tmp_path / "junit.xml").read_text().count("'of': 'noise'") == 2


def test_failures_show_the_line_of_the_test_and_no_warning_of_others(tmp_path: Path) -> None:
    (tmp_path / "test_curves.py").write_text(
        "from digs_warp.sim.testing.curve import DegradationCurve\n"
        "CURVE = DegradationCurve((0.0, 1.0, 2.0), (0.0, 1.0, 9.0))\n"
        "def test_limit(): CURVE.assert_at_most({1: 0.5})\n"
        "def test_cliff(): CURVE.assert_no_cliff(largest_growth=1.0)\n"
    )
    said = run_pytest(tmp_path, "-q").stdout
    assert "test_curves.py:3: AssertionError" in said and "test_curves.py:4: AssertionError" in said
    assert "curve.py:" not in said.replace("test_curves.py:", "")
    assert "falls off a cliff" in said and "2 failed" in said and "warning" not in said


WRONG = [
    ("strenghts=(0, 1)", "no setting 'strenghts'; did you mean 'strengths'?"),
    ("'law'", "found ('law',), expected keyword arguments only"),
    ("effects='miror'", "no effect 'miror'; did you mean 'mirror'?"),
    ("effects=('mirror', 'quantm')", "no effect 'quantm'; did you mean 'quantum'?"),
    ("effects=()", "effects: found no name"),
    ("effects=each()", "effects: found no name"),
    ("frames=0", "--frames: 0, expected 1 to 100,000"),
    ("strengths=(2, 1)", "expected rising numbers"),
    ("strengths='auto'", "expected finite numbers"),
    ("width='wide'", "settings: width is 'wide', expected a whole number"),
    ("tier='perfect'", "settings: tier is 'perfect', expected one of truth, law"),
    ("profile='d434'", "profile 'd434': not known; did you mean 'd435'?"),
    (
        "mesh='nowhere.glb'",
        "'nowhere.glb': no such file; a relative path starts where pytest runs",
    ),
    ("scene=('a.glb', 'b.glb')", "'a.glb': no such file"),
]


def test_a_wrong_marker_stops_the_collection_in_one_line() -> None:
    for arguments, reason in WRONG:
        names = {"pytest": pytest, "each": each}
        marker = eval(f"pytest.mark.sensor_noise({arguments})", names).mark
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
