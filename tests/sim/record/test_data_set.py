"""Many scenes: every combination once, failures reported, one summary, resumable."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.data.capture import read_capture
from digs_warp.data.images import write_image
from digs_warp.engines.config import EngineConfig
from digs_warp.engines.task import RESULTS
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.data_set import SceneResult, plan_jobs, simulate_many
from digs_warp.sim.record.record import simulate
from reference.file_hashes import file_hashes
from reference.mesh_files import TETRAHEDRON

TINY = SimulateConfig(profile="bare-matcher", frames=2, width=48, samples_per_pixel=1)
FLAGS = ["--frames", "2", "--width", "48", "--samples-per-pixel", "1", "--tier", "law"]


@pytest.fixture
def inputs(tmp_path: Path) -> Path:
    """Two good meshes, a broken one, and two skies."""
    folder = tmp_path / "inputs"
    folder.mkdir()
    (folder / "pyramid.obj").write_text(TETRAHEDRON)
    (folder / "other.obj").write_text(TETRAHEDRON.replace("0 0 1", "0 0 2"))
    (folder / "broken.obj").write_text("v 0 0 0\n")
    for name in ("day", "night"):
        pixels = np.random.default_rng(len(name)).integers(0, 256, (16, 32, 3), dtype=np.uint8)
        write_image(folder / f"{name}.png", pixels)
    return folder


def test_every_combination_gets_a_folder_and_a_seed() -> None:
    jobs = plan_jobs(TINY, [Path("a/cup.obj"), Path("b/pot.glb")], [Path("sky.hdr")], 3)
    assert [job.name for job in jobs] == [
        *(f"cup/sky/{walk:02d}" for walk in range(3)),
        *(f"pot/sky/{walk:02d}" for walk in range(3)),
    ]
    assert [job.config.seed for job in jobs] == [0, 1, 2, 0, 1, 2]
    assert {job.config.mesh for job in jobs} == {Path("a/cup.obj"), Path("b/pot.glb")}
    (alone,) = plan_jobs(TINY, [], [])
    assert alone.name == "built-in-object/built-in-room/00" and alone.config == TINY


def test_equal_names_are_told_apart_by_their_folders() -> None:
    jobs = plan_jobs(TINY, [Path("a/mesh.obj"), Path("b/mesh.obj"), Path("c/cup.obj")], [])
    assert [job.name.split("/")[0] for job in jobs] == ["a-mesh.obj", "b-mesh.obj", "cup"]
    with pytest.raises(DigsError, match=r"a-mesh\.obj"):
        plan_jobs(TINY, [Path("x/a/mesh.obj"), Path("y/a/mesh.obj")], [])


def test_a_scene_that_fails_does_not_stop_the_rest(inputs: Path, tmp_path: Path) -> None:
    meshes = [inputs / "broken.obj", inputs / "missing.obj", inputs / "pyramid.obj"]
    # A plain pyramid in 48 pixels has nothing to match.
    results = simulate_many(plan_jobs(replace(TINY, tier="law"), meshes, []), tmp_path / "set")
    assert ["0 faces" in results[0].error, "no such file" in results[1].error] == [True, True]
    done = results[2]
    assert done.error == "" and done.frames == 2 and done.seconds > 0
    assert done.fill is not None and 0.5 < done.fill <= 1
    assert done.error_mm is not None and 1 < done.error_mm < 300  # a pixel of disparity is 200 mm
    summary = json.loads((tmp_path / "set/summary.json").read_text())
    assert [SceneResult(**scene) for scene in summary["scenes"]] == list(results)


def test_the_command_records_resumes_and_complains(
    inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "set"
    sky = str(inputs / "*.png")
    command = ["simulate", *FLAGS, "--environments", sky, "--out", str(out)]
    good = [*command, "--meshes", str(inputs / "[op]*.obj")]
    assert main(good) == EXIT_OK
    printed = capsys.readouterr().out
    captures = sorted(path.parent.relative_to(out) for path in out.rglob("transforms.json"))
    assert [str(path) for path in captures] == [
        f"{mesh}/{sky}/00" for mesh in ("other", "pyramid") for sky in ("day", "night")
    ]
    assert all(f"{path} " in printed for path in captures) and "4 scenes" in printed
    (out / "pyramid/day/00/transforms.json").unlink()
    (out / "pyramid/day/00/depth/0001.exr").unlink()
    before = file_hashes(out / "pyramid/night/00")
    assert main([*good, "--resume"]) == EXIT_OK
    assert len(read_capture(out / "pyramid/day/00")) == 2
    assert file_hashes(out / "pyramid/night/00") == before
    assert main(["info", str(out)]) == EXIT_OK
    assert "4 scenes" in capsys.readouterr().out

    meshes, day = str(inputs / "[bp]*.obj"), str(inputs / "day.png")
    bad = ["--meshes", meshes, "--environments", day, "--out", str(tmp_path / "bad")]
    assert main(["simulate", *FLAGS, *bad]) == EXIT_BAD_INPUT
    message = capsys.readouterr().err
    assert "1 of 2 scenes failed" in message and "broken/day/00" in message
    assert (tmp_path / "bad/pyramid/day/00/transforms.json").is_file()


@pytest.mark.long
def test_scenes_on_dask_are_those_of_one_process(inputs: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="dask and distributed are not installed")
    config = replace(TINY, tier="law", environment=inputs / "day.png")
    jobs = plan_jobs(config, [inputs / "pyramid.obj", inputs / "other.obj"], [])
    engine = EngineConfig(engine="dask", workers=2)
    assert [r.error for r in simulate_many(jobs, tmp_path / "set", engine)] == ["", ""]
    for job in jobs:
        simulate(job.config, tmp_path / "one" / job.name)
        assert file_hashes(tmp_path / "one" / job.name) == file_hashes(tmp_path / "set" / job.name)
    lines = [json.loads(line) for line in (tmp_path / "set" / RESULTS).read_text().splitlines()]
    assert sorted(line["name"] for line in lines) == sorted(job.name for job in jobs)


@pytest.mark.parametrize(
    ("flags", "code", "word"),
    [
        (["--engine", "dask"], EXIT_WRONG_USAGE, "are for many scenes; give --scenes"),
        (["--engine", "dusk", "--scenes", "2"], EXIT_WRONG_USAGE, "did you mean 'dask'?"),
        (["--meshes", "nothing/*.glb"], EXIT_BAD_INPUT, "no file matches"),
        (["--meshes", "*.glb", "--mesh", "a.glb"], EXIT_WRONG_USAGE, "contradict"),
        (["--trajectories", "0"], EXIT_WRONG_USAGE, "--trajectories: 0, expected 1 to 10,000"),
        (["--randomize", "indoor"], EXIT_WRONG_USAGE, "how many scenes? Give --scenes"),
        (["--scenes", "2", "--trajectories", "2"], EXIT_WRONG_USAGE, "contradict each other"),
        (["--scenes", "2", "--randomize", "indor"], EXIT_BAD_INPUT, "did you mean 'indoor'"),
    ],
)
def test_wrong_flags_are_explained_before_anything_is_written(
    flags: list[str], code: int, word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", *flags, "--out", str(tmp_path / "set")]) == code
    assert word in capsys.readouterr().err
    assert not (tmp_path / "set").exists()
