import json
from pathlib import Path

import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.usd.capture_scene import write_capture_scene
from digs_warp.usd.writer import WriteOptions, write_gaussians
from reference.capture_scenes import full_scene, splats


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scenes")
    write_capture_scene(path / "capture.usdz", full_scene())
    write_gaussians(path / "a.usdc", splats(20), {"settings": {"iterations": 100}})
    half = WriteOptions(precision="half", sh_degree=1)
    write_gaussians(path / "b.usda", splats(20), {"settings": {"iterations": 200}}, half)
    text = (
        (path / "b.usda").read_text().replace("half[] opacitiesh = [", "half[] opacitiesh = [7, ")
    )
    (path / "broken.usda").write_text(text)
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = main(["usd", *map(str, arguments)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_info_says_what_a_capture_scene_holds(folder: Path, capsys: pytest.CaptureFixture[str]):
    target = folder / "info.json"
    code, out, _ = run(capsys, "info", folder / "capture.usdz", "--json", target)
    assert code == EXIT_OK
    for words in (
        "40 at /Asset/Gaussians",
        "depth, random_points, sfm",
        "full, half, preview",
        "/Asset/Rig/left, /Asset/Rig/right; 9 views",
    ):
        assert words in out
    assert json.loads(target.read_text())["metadata"]["settings"] == {"iterations": 200}


def test_precision_is_told(folder: Path, capsys: pytest.CaptureFixture[str]):
    assert "half" in run(capsys, "info", folder / "b.usda")[1]
    assert "float" in run(capsys, "info", folder / "a.usdc")[1]


def test_a_sound_scene_passes_and_a_broken_one_exits_with_1(
    folder: Path, capsys: pytest.CaptureFixture[str]
):
    code, out, _ = run(capsys, "validate", folder / "capture.usdz")
    assert code == EXIT_OK
    assert "0 errors, 0 warnings in 9 combinations" in out
    target = folder / "report.json"
    code, out, err = run(capsys, "validate", folder / "broken.usda", "--json", target)
    assert code == EXIT_BAD_INPUT
    assert "21 values in 'opacities', expected 20" in err
    report = json.loads(target.read_text())
    assert not report["ok"]
    assert {finding["rule"] for finding in report["findings"]} >= {"splat-count", "opacity-range"}
    code, _, err = run(capsys, "validate", folder / "a.usdc", "--json", target)
    assert code == EXIT_BAD_INPUT
    assert "file exists" in err


def test_diff_names_what_differs_and_by_how_much(folder: Path, capsys: pytest.CaptureFixture[str]):
    same = run(capsys, "diff", folder / "a.usdc", folder / "a.usdc")[1]
    assert same.startswith("the Gaussians and what is recorded about them are the same")
    _, out, _ = run(capsys, "diff", folder / "a.usdc", folder / "b.usda")
    lines = dict(line.split(": ", 1) for line in out.splitlines())
    assert lines["sh degree"] == "3 | 1"
    assert lines["metadata settings.iterations"] == "100 | 200"
    # Halves keep 11 bits of positions within 0.2 m.
    assert 1e-6 < float(lines["positions"].split()[2]) < 2e-4
    assert 0 < float(lines["rotations"].split()[2]) < 0.2
    _, out, _ = run(capsys, "diff", folder / "a.usdc", folder / "capture.usdz")
    assert "splats: 20 | 40" in out


def test_wrong_numbers_of_files_are_wrong_usage(folder: Path, capsys: pytest.CaptureFixture[str]):
    for arguments in (("diff", "a.usdz"), ("info", "a.usdz", "b.usdz"), ("look", "a.usdz")):
        assert run(capsys, *arguments)[0] == EXIT_WRONG_USAGE
