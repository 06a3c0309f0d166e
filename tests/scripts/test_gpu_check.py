"""The check of the kernels for CUDA runs on a CPU, with few packages, and notices what is wrong."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from gpu_check import PARTS, arguments, in_own_process, main, run_of
from gpu_checks.images import compare_images, take_order
from gpu_checks.parts import Findings, read, relative, run_part

from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from reference.splat_scenes import NEAR, camera, random_gaussians

ROOT = Path(__file__).resolve().parents[2]
SMALL = ["--device", "cpu", "--splats", "200", "--size", "49x35", "--steps", "3"]

# Python runs it at every start: all that is neither its own nor on the list cannot be imported.
FEW_PACKAGES = """
import sys
ALLOWED = {"numpy", "scipy", "cv2", "warp", "digs_warp", "gpu_check", "gpu_checks"}
class Refusal:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        own = top in sys.stdlib_module_names or top.startswith("_sysconfigdata")
        if not own and top not in ALLOWED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Refusal())
"""


def test_all_parts_pass_with_numpy_scipy_opencv_and_warp_alone(tmp_path: Path) -> None:
    path = tmp_path / "found.jsonl"
    (tmp_path / "sitecustomize.py").write_text(FEW_PACKAGES)
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT}"}
    given = [*SMALL, "--here", "--json", str(path)]
    command = [sys.executable, str(ROOT / "scripts/gpu_check.py"), *given]
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [findings.part for findings in read(path)] == list(PARTS)
    assert all(findings.figures for findings in read(path))


def test_an_exception_is_a_finding(capsys: pytest.CaptureFixture[str]) -> None:
    def broken(run: object, findings: Findings) -> None:
        findings.note("before", 1)
        raise RuntimeError("no such kernel")

    findings = run_part("broken", broken, run_of(arguments(SMALL)))
    assert findings.figures == {"before": 1}
    assert "no such kernel" in findings.failures[0]
    assert "broken: FAILED" in capsys.readouterr().out


def test_a_process_that_ends_without_findings_is_one(tmp_path: Path) -> None:
    path = tmp_path / "found.jsonl"
    path.touch()
    in_own_process("machine", path, ["--splats", "many"])
    assert read(path)[0].failures == ["machine: ended with code 2"]


def test_the_last_line_is_the_verdict(capfd: pytest.CaptureFixture[str]) -> None:
    assert main([*SMALL, "--only", "machine,ssim"]) == 0
    assert capfd.readouterr().out.splitlines()[-1] == "PASS"


def test_a_device_that_is_not_there_is_no_pass(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--device", "cuda:77"]) == 2
    assert "cuda:77" in capsys.readouterr().out


def test_nan_and_wrong_pixels_fail() -> None:
    findings = Findings("test")
    image = np.full((20, 30, 3), 0.5)
    compare_images("same", image, image, findings)
    findings.at_most("difference", relative(np.ones(3), np.ones(3)), 0.0)
    assert findings.failures == []
    other = image.copy()
    other[3, 4, 1] = 0.6
    compare_images("a pixel", other, image, findings)
    other[3, 4, 1] = np.nan
    compare_images("no number", other, image, findings)
    findings.at_most("nothing", np.nan, 1.0)
    findings.at_least("nothing", np.nan, 1.0)
    assert len(findings.failures) == 6


def test_splats_of_nearly_one_depth_are_drawn_in_the_order_of_the_other() -> None:
    view, gaussians = camera(), random_gaussians(6, seed=2)
    gaussians.log_scales[:2], gaussians.opacity_logits[:2] = -2.5, 1.0

    def drawn(apart: float) -> SplatRenderer:
        gaussians.means[0], gaussians.means[1] = 0.0, apart * view.world_from_cam[:3, 2]
        renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians), 41, 37)
        renderer.forward(view, near=NEAR)
        return renderer

    one, other = drawn(1e-6), drawn(-1e-6)
    expected = other.image.to_numpy()
    assert np.abs(one.image.to_numpy() - expected).max() > 0.05
    apart, moved = take_order(one, other)
    assert 1e-6 < apart < 3e-6
    assert moved >= 2
    assert np.abs(one.image.to_numpy() - expected).max() < 1e-4
