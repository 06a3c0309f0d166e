"""What the commands print, write and resume, each run whole on something tiny, compiled ahead."""

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
import warp as wp

from digs_warp import cli
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.commands import precompile
from digs_warp.commands.reconstruct import Reconstruct
from digs_warp.commands.run import Run
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import ball


def test_reconstruct_then_info_and_export_work_on_its_folder(
    capture_folder: Path, tmp_path: Path, capsys
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


def test_simulate_writes_a_capture_and_resumes_it(tmp_path: Path, capsys) -> None:
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
    tmp_path: Path, capsys
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


TINY_PLAN = ["--width", "64", "--samples-per-pixel", "1", "--frames", "2"]


def test_the_plan_names_every_effect_and_lands_in_the_file(tmp_path: Path, capsys) -> None:
    path = tmp_path / "plan.json"
    assert (
        main(["plan", *TINY_PLAN, "--json", str(path), "--effects", "mirror,shot-noise"]) == EXIT_OK
    )
    printed = capsys.readouterr().out
    plan = json.loads(path.read_text())
    assert plan["facts"]["frames"] == 2
    for choice in (*plan["depth"], *plan["color"]):
        state = "on" if choice["on"] else "off"
        (line,) = (row for row in printed.splitlines() if row.split()[:1] == [choice["effect"]])
        assert line.split()[1] == state
        assert choice["statistic"] in line and choice["reason"] in line
    on = {each["effect"] for each in (*plan["depth"], *plan["color"]) if each["on"]}
    assert on == {"mirror", "shot-noise"} and list(tmp_path.iterdir()) == [path]


def test_it_serves_its_page_until_it_is_interrupted(tmp_path: Path) -> None:
    ball().save(tmp_path / "ball.npz")
    process = subprocess.Popen(
        [sys.executable, "-m", "digs_warp", "view", str(tmp_path / "ball.npz")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    address = process.stdout.readline().split()[0]
    assert address.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(address) as answer:
        page = answer.read().decode()
    assert "<html" in page
    assert "https://" not in page.replace("https://opengraph", "")  # nothing from the network
    process.send_signal(signal.SIGTERM)  # SIGINT is ignored in processes of a shell's background
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out.strip(), err) == (0, "closed", "")


def test_all_kernels_are_in_six_sets_of_options(tmp_path: Path, monkeypatch) -> None:
    # Each more costs a first run as much as ten small modules.
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    sources = precompile._sources_with_warp()
    sets = precompile._sets(sources)
    kernels = {name for name, text in sources.items() if "@wp.kernel" in text}
    only_on_gpus = {"digs_warp.splat.cooperative"}
    assert {name for each in sets for name in each} == kernels - only_on_gpus
    assert len(sets) == 6


def test_what_is_compiled_is_not_compiled_again(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    one = {"digs_warp.splat.bin_tiles": "@wp.kernel"}
    monkeypatch.setattr(precompile, "_sources_with_warp", lambda: one)
    assert precompile.compile_kernels() > 0.0
    assert [each.name[:-8] for each in tmp_path.glob("wp_*")] == ["wp_digs_warp.splat.bin_tiles"]
    assert precompile._sets(one) == []
    assert precompile.compile_kernels() == 0.0


@pytest.mark.long
def test_nothing_is_left_to_compile_for_a_run(tmp_path: Path) -> None:
    code = f"""
from digs_warp.cli import main
from digs_warp.device.warp_start import compile_seconds
sizes = ["--frames", "9", "--width", "160", "--height", "90", "--iterations", "20"]
assert main(["run", "--out", {str(tmp_path / "out")!r}, *sizes]) == 0
assert compile_seconds() == 0.0
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"WARP_CACHE_PATH": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
