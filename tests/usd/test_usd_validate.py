"""The validator passes what we write, says what it did not check, and judges packages and damaged files."""

import importlib.util
import json
from pathlib import Path

import pytest

from digs_warp.checks import UsdError
from digs_warp.usd.capture_scene import write_capture_scene
from digs_warp.usd.convert import Precision
from digs_warp.usd.findings import Report
from digs_warp.usd.validate import validate
from digs_warp.usd.writer import WriteOptions, write_gaussians
from reference.capture_scenes import full_scene, splats

HAS_NVIDIA = importlib.util.find_spec("usd_validation_nvidia") is not None


def status(report: Report, name: str) -> str:
    return next(check.status for check in report.checks if check.name == name)


@pytest.mark.parametrize(
    ("suffix", "precision", "degree"),
    [
        (".usda", "half", 0),
        (".usdc", "float", 3),
        (".usdz", "mixed", 0),
    ],
)
def test_what_we_write_passes(tmp_path: Path, suffix: str, precision: Precision, degree: int):
    path = tmp_path / f"scene{suffix}"
    write_gaussians(
        path, splats(50, degree=degree), {"psnr": 30.0}, WriteOptions(precision=precision)
    )
    report = validate(path)
    # NVIDIA's rule wants float arrays.
    ours = [finding for finding in report.findings if finding.rule != "NVIDIA VG.035"]
    assert ours == []
    assert status(report, "splats and scene") == "passed"
    assert status(report, "OpenUSD validators") == "passed"
    if HAS_NVIDIA and precision == "float":
        assert status(report, "NVIDIA VG.035") == "passed"


def test_all_variants_of_a_capture_pass(tmp_path: Path):
    write_capture_scene(tmp_path / "scene.usdz", full_scene())
    report = validate(tmp_path / "scene.usdz")
    assert report.findings == ()
    assert report.combinations == 9


@pytest.mark.skipif(HAS_NVIDIA, reason="NVIDIA's validator is installed")
def test_what_was_not_run_is_not_called_passed(tmp_path: Path):
    write_gaussians(tmp_path / "scene.usdc", splats(5))
    report = validate(tmp_path / "scene.usdc")
    assert status(report, "NVIDIA VG.035") == "not checked"
    checks = {check["name"]: check["status"] for check in json.loads(report.json())["checks"]}
    assert checks["NVIDIA VG.035"] == "not checked"
    assert "not checked (install usd-validation-nvidia)" in report.text()


def test_a_scene_without_splats_is_only_warned_of(tmp_path: Path):
    write_gaussians(tmp_path / "scene.usdc", splats(0))
    report = validate(tmp_path / "scene.usdc")
    assert report.ok or HAS_NVIDIA
    assert "splat-count" in {finding.rule for finding in report.findings}


def test_packages_of_other_programs_are_judged_by_their_structure(tmp_path: Path):
    import zipfile

    write_gaussians(tmp_path / "scene.usda", splats(5))
    path = tmp_path / "other.usdz"
    with zipfile.ZipFile(path, "w") as archive:  # no padding: members are not aligned
        archive.write(tmp_path / "scene.usda", "other.usda")
    report = validate(path)
    assert any("ByteMisalignment" in finding.rule for finding in report.findings), report.text()
    assert status(report, "OpenUSD validators") == "failed"


def test_files_that_are_no_scene_are_an_error(tmp_path: Path):
    (tmp_path / "scene.usdc").write_bytes(b"no")
    with pytest.raises(UsdError, match=r"scene\.usdc"):
        validate(tmp_path / "scene.usdc")
