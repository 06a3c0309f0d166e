"""What the commands print, write and resume, each run whole on something tiny."""

import re
from pathlib import Path

import pytest

from digs_warp import cli
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.commands.reconstruct import Reconstruct
from digs_warp.commands.run import Run
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.train.config import Stop, TrainConfig


def test_reconstruct_then_info_and_export_work_on_its_folder(
    capture_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "reconstruction"
    arguments = ["reconstruct", str(capture_folder), "--out", str(folder), "--iterations", "2"]
    assert main([*arguments, "--voxel-size", "0.05"]) == EXIT_OK
    summary = capsys.readouterr().out
    assert re.fullmatch(
        rf"{folder}/gaussians.npz: [\d,]+ Gaussians from 3 frames in voxels of 50 mm, "
        r"PSNR .* dB .*, [\d.]+ s\n(good: |poor, because ).*\n"
        rf"next: digs-warp report {folder}, or look around: digs-warp view {folder}\n",
        summary,
    )
    assert main(["info", str(folder)]) == EXIT_OK
    assert "PSNR" in capsys.readouterr().out
    assert main(["export-usd", str(folder), "--out", str(tmp_path / "scene.usdz")]) == EXIT_OK


TINY = ["--frames", "2", "--width", "32", "--height", "18", "--samples-per-pixel", "1"]


def test_simulate_writes_a_capture_and_resumes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "capture"
    arguments = ["simulate", *TINY, "--out", str(folder)]
    assert main(arguments) == EXIT_OK
    assert "2 frames of 32 x 18" in capsys.readouterr().out
    before = {path: path.read_bytes() for path in (folder / "images").iterdir()}
    lost = folder / "images" / "0001.png"
    lost.unlink()
    assert main([*arguments, "--resume"]) == EXIT_OK
    assert {path: path.read_bytes() for path in (folder / "images").iterdir()} == before


def test_run_leaves_scene_and_report_and_resumes_after_an_interruption(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "out"
    sizes = ["--frames", "3", "--width", "48", "--height", "32", "--samples-per-pixel", "1"]
    arguments = ["run", "--out", str(folder), *sizes, "--iterations", "2", "--voxel-size", "0.03"]
    assert main(arguments) == EXIT_OK
    summary = capsys.readouterr().out
    left = [
        "capture",
        "files.jsonl",
        "reconstruction",
        "report.html",
        "run.json",
        "scene.usdz",
        "splats.ply",
    ]
    assert sorted(path.name for path in folder.iterdir()) == left
    assert all(
        str(folder / name) in summary for name in left if name not in ("run.json", "files.jsonl")
    )
    assert re.search(r"^done .* PSNR [\d.]+ dB .* \d+ s$", summary, re.MULTILINE)

    scene = (folder / "scene.usdz").read_bytes()
    (folder / "scene.usdz").unlink()  # as if the run had been cut off before the export
    assert main(arguments) == EXIT_BAD_INPUT
    assert main([*arguments, "--resume"]) == EXIT_OK
    assert (folder / "scene.usdz").read_bytes() == scene
    assert main([*arguments, "--resume", "--seed", "1"]) == EXIT_BAD_INPUT
    assert "seed 0 -> 1" in capsys.readouterr().err


def test_one_seed_serves_all_stages_of_a_run() -> None:
    command = cli.parse(["run", "--out", "x", "--seed", "5", "--iterations", "7"])
    assert isinstance(command, Run)
    assert command.recording.seed == 5
    config = command.reconstruct_config(command.recording.seed)
    assert config.train == TrainConfig(stop=Stop(iterations=7), seed=5)
    assert config.sfm == SfmConfig(poses="capture", sfm_seed=5)


def test_density_control_follows_the_start() -> None:
    for flags, density in [
        ([], "fixed"),
        (["--strategy", "random"], "adaptive"),
        (["--strategy", "random", "--density", "fixed"], "fixed"),
        (["--density", "adaptive"], "adaptive"),
    ]:
        command = cli.parse(["reconstruct", "capture", "--out", "x", *flags])
        assert isinstance(command, Reconstruct)
        assert command.reconstruct_config(0).train.density.strategy == density
