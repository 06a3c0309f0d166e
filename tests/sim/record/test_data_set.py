"""Many scenes, of all combinations or at random: recorded, repeated, resumed, failures reported."""

import json
import pickle
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
from digs_warp.sim.record import session
from digs_warp.sim.record.data_set import SceneResult, plan_jobs, simulate_many
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.randomize.draws import draw_scenes
from digs_warp.sim.record.randomize.randomization import (
    OBJECT_COUNT,
    SHIPPED,
    Randomization,
    entries_of,
    load_randomization,
)
from digs_warp.sim.record.record import simulate
from reference.file_hashes import file_hashes
from reference.mesh_files import TETRAHEDRON

TINY = SimulateConfig(profile="bare-matcher", frames=2, width=48, samples_per_pixel=1)
FLAGS = ["--frames", "2", "--width", "48", "--samples-per-pixel", "1", "--tier", "law"]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two good meshes, a broken one, two skies, and a randomization."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "pyramid.obj").write_text(TETRAHEDRON)
    (folder / "tower.obj").write_text(TETRAHEDRON.replace("0 0 1", "0 0 3"))
    (folder / "broken.obj").write_text("v 0 0 0\n")
    for name in ("day", "night"):
        pixels = np.random.default_rng(len(name)).integers(0, 256, (16, 32, 3), dtype=np.uint8)
        write_image(folder / f"{name}.png", pixels)
    (folder / "mine.yaml").write_text("base: wild\nenvironment: '*.png'\nlabels: normals\n")
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
    good = [*command, "--meshes", str(inputs / "[pt]*.obj")]
    assert main(good) == EXIT_OK
    printed = capsys.readouterr().out
    captures = sorted(path.parent.relative_to(out) for path in out.rglob("transforms.json"))
    assert [str(path) for path in captures] == [
        f"{mesh}/{sky}/00" for mesh in ("pyramid", "tower") for sky in ("day", "night")
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
    jobs = plan_jobs(config, [inputs / "pyramid.obj", inputs / "tower.obj"], [])
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


def record(inputs: Path, out: Path) -> int:
    scenes = ["--scenes", "3", "--randomize", str(inputs / "mine.yaml"), "--seed", "5"]
    meshes = ["--meshes", str(inputs / "[pt]*.obj")]
    return main(["simulate", *FLAGS, *scenes, *meshes, "--out", str(out)])


def test_scenes_are_recorded_and_repeated(inputs: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    assert record(inputs, out) == EXIT_OK
    names = ["0000", "0001", "0002"]
    assert sorted(path.parent.name for path in out.rglob("transforms.json")) == names
    summary = json.loads((out / "summary.json").read_text())["scenes"]
    assert [scene["name"] for scene in summary] == names
    assert [scene["error"] for scene in summary] == [""] * 3

    # Draws and settings agree, and the file's keys are among them.
    for scene in summary:
        settings = json.loads((out / scene["name"] / "run.json").read_text())["settings"]
        flat = {**settings, **settings["look"], **settings["walk"]}
        assert {key: flat[key] for key in scene["drawn"]} == scene["drawn"]
        assert scene["drawn"].keys() > {"environment", "light_level", "labels", "seed"}
        assert scene["drawn"].keys() & {"mesh", "scene"}
    assert len({json.dumps(scene["drawn"]) for scene in summary}) == 3

    # A scene can be made again from its record alone.
    again = tmp_path / "again"
    assert (
        main(["simulate", "--config", str(out / "0001/run.json"), "--out", str(again)]) == EXIT_OK
    )
    assert pixels_of(again) == pixels_of(out / "0001")


def pixels_of(folder: Path) -> dict[str, str]:
    """Hashes of all files but the records, which name times."""
    records = ("run.json", "files.jsonl")
    return {name: each for name, each in file_hashes(folder).items() if name not in records}


ENTRIES = {k: e for name in SHIPPED for k, e in load_randomization(name).entries.items()}


@pytest.mark.parametrize("key", ENTRIES)
def test_every_key_of_ours_changes_what_is_recorded(
    key: str, inputs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is recorded is compared before it is rendered."""
    monkeypatch.setattr(session, "_make_renderer", lambda *_: None)
    values = [ENTRIES[key].at(share) for share in (0.05, 0.6)] if key != "ground" else []
    low, high = (prepared(key, value, inputs) for value in values or ("table", "floor"))
    assert low != high, f"{ENTRIES[key].words} records the same"


def prepared(key: str, value: object, inputs: Path) -> bytes:
    """A tinted, shiny object in its surround, the poses, and the factor on the errors, with one key set."""
    content = {"ground": "table", "tint": 0.5, "roughness_factor": 0.3, key: value}
    mine = Randomization("mine", entries_of(content, inputs, "mine"))
    config = SimulateConfig(profile="bare-matcher", environment=inputs / "day.png", frames=3)
    meshes = sorted(inputs.glob("[pt]*.obj"))[: None if key == OBJECT_COUNT else 1]
    (scene,) = draw_scenes(mine, config, 1, meshes)
    ready = session.prepare_session(scene.config, load_inputs(scene.config))
    poses = [ready.walk.pose(moment) for moment in ready.moments]
    return pickle.dumps((ready.scene, ready.environment, poses, scene.config.strength))
