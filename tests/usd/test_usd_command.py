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


def test_info_says_what_a_scene_holds(folder: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["info", str(folder / "capture.usdz")]) == EXIT_OK
    out = capsys.readouterr().out
    for words in (
        *("40 at /Asset/Gaussians", "depth, random_points, sfm", "full, half, preview", "float"),
        *("/Asset/Rig/left, /Asset/Rig/right; 9 views", "Y up, 1 m per unit"),
    ):
        assert words in out
    assert main(["info", str(folder / "b.usda")]) == EXIT_OK
    out = capsys.readouterr().out
    assert "half" in out and "degree 1" in out and "cameras" not in out


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


def test_wrong_numbers_of_files_are_wrong_usage(folder: Path, capsys: pytest.CaptureFixture[str]):
    for arguments in (("validate",), ("validate", "a.usdz", "b.usdz"), ("look", "a.usdz")):
        assert run(capsys, *arguments)[0] == EXIT_WRONG_USAGE
