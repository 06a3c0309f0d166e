"""A data set at random, from the command line to the files: recorded, repeatable, resumable."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import EXIT_OK, main
from digs_warp.data.images import write_image
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record import session
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.randomize.draws import draw_scenes
from digs_warp.sim.record.randomize.randomization import (
    OBJECT_COUNT,
    SHIPPED,
    Randomization,
    entries_of,
    load_randomization,
)
from reference.file_hashes import file_hashes
from reference.mesh_files import TETRAHEDRON

FLAGS = ["--frames", "2", "--width", "48", "--samples-per-pixel", "1", "--tier", "law"]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two meshes, two skies, and a randomization."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "pyramid.obj").write_text(TETRAHEDRON)
    (folder / "tower.obj").write_text(TETRAHEDRON.replace("0 0 1", "0 0 3"))
    for name in ("day", "night"):
        pixels = np.random.default_rng(len(name)).integers(0, 256, (16, 32, 3), dtype=np.uint8)
        write_image(folder / f"{name}.png", pixels)
    (folder / "mine.yaml").write_text("base: wild\nenvironment: '*.png'\nlabels: normals\n")
    return folder


def record(inputs: Path, out: Path, *more: str) -> int:
    scenes = ["--scenes", "3", "--randomize", str(inputs / "mine.yaml"), "--seed", "5"]
    meshes = ["--meshes", str(inputs / "*.obj")]
    return main(["simulate", *FLAGS, *scenes, *meshes, "--out", str(out), *more])


def test_scenes_are_recorded_repeated_and_resumed(inputs: Path, tmp_path: Path) -> None:
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
    whole = pixels_of(out / "0001")
    assert pixels_of(again) == whole

    # An interrupted run makes what is missing, and keeps the rest.
    (out / "0001/transforms.json").unlink()
    (out / "0001/depth/0001.exr").unlink()
    kept = {path: path.stat().st_mtime_ns for path in (out / "0002").rglob("*.png")}
    assert record(inputs, out, "--resume") == EXIT_OK
    assert pixels_of(out / "0001") == whole
    assert {path: path.stat().st_mtime_ns for path in (out / "0002").rglob("*.png")} == kept


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
    meshes = sorted(inputs.glob("*.obj"))[: None if key == OBJECT_COUNT else 1]
    (scene,) = draw_scenes(mine, config, 1, meshes)
    ready = session.prepare_session(scene.config, load_inputs(scene.config))
    poses = [ready.walk.pose(moment) for moment in ready.moments]
    return pickle.dumps((ready.scene, ready.environment, poses, scene.config.strength))
