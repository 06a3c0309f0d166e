"""A data set at random, from the command line to the files: recorded, repeatable, resumable."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.data.images import write_image
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.draws import (
    SHIPPED,
    Distribution,
    Randomization,
    draw_scenes,
    even,
    load_randomization,
)
from digs_warp.sim.record.record import simulate_in_memory
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


@pytest.mark.parametrize(
    ("flags", "code", "word"),
    [
        (["--scenes", "0"], EXIT_WRONG_USAGE, "--scenes: 0, expected 1 to 100,000"),
        (["--randomize", "indoor"], EXIT_WRONG_USAGE, "how many scenes? Give --scenes"),
        (["--scenes", "2", "--trajectories", "2"], EXIT_WRONG_USAGE, "contradict each other"),
        (["--scenes", "2", "--randomize", "indor"], EXIT_BAD_INPUT, "did you mean 'indoor'"),
        (["--scenes", "2", "--randomize", "a.yaml"], EXIT_BAD_INPUT, "'a.yaml': no such file"),
    ],
)
def test_wrong_flags_are_explained_before_anything_is_written(
    flags: list[str], code: int, word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", *flags, "--out", str(tmp_path / "set")]) == code
    assert word in capsys.readouterr().err
    assert not (tmp_path / "set").exists()


DRAWN_KEYS = sorted({key for name in SHIPPED for key in load_randomization(name).entries})


# Keys of which ours have one value.
UNLIKE = {"ground": even(["table", "floor"])}


@pytest.mark.parametrize("key", DRAWN_KEYS)
def test_every_key_of_ours_changes_what_is_recorded(key: str, inputs: Path) -> None:
    wild, tabletop = (load_randomization(name).entries for name in ("wild", "tabletop"))
    entry = UNLIKE.get(key) or wild.get(key) or tabletop[key]
    low, high = (recorded(key, entry, share, inputs) for share in (0.05, 0.6))
    assert any(not np.array_equal(a, b, equal_nan=True) for a, b in zip(low, high, strict=True)), (
        f"{entry.words} records the same"
    )


def recorded(key: str, entry: Distribution, share: float, inputs: Path) -> list[np.ndarray]:
    """Color and sensed depth of a tinted, shiny object with one setting at a quantile."""
    config = SimulateConfig(
        profile="bare-matcher",
        mesh=inputs / "pyramid.obj",
        environment=inputs / "day.png",
        frames=1,
        width=64,
        samples_per_pixel=1,
        tier="law",
    )
    usual = {
        "ground": even(["table"]),
        "tint": even([0.5]),
        "roughness_factor": even([0.3]),
    }
    mine = Randomization("mine", {**usual, key: even([entry.at(share)])})
    counts = ("object_count", "distractor_mesh_count")
    meshes = sorted(inputs.glob("*.obj")) if key in counts else []
    (scene,) = draw_scenes(mine, replace(config, mesh=None) if meshes else config, 1, meshes)
    frame = simulate_in_memory(scene.config).frames[0]
    return [frame.load_image(), frame.load_depth()]
