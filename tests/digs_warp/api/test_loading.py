"""`load` knows files and folders, settings the names and checks of the flags, public names one home."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest

import digs_warp
import digs_warp as dw
from digs_warp.api.settings import setting_names, with_settings
from digs_warp.checks import DigsError
from digs_warp.commands.reconstruction_options import ReconstructionOptions
from digs_warp.sim.config import SimulateConfig
from reference.splat_scenes import random_gaussians

GAUSSIANS = random_gaussians(5, seed=1)


def test_a_capture_folder_is_a_capture(capture_folder: Path) -> None:
    loaded = dw.load(str(capture_folder))
    assert isinstance(loaded, dw.Capture) and loaded.stored_in == capture_folder


@pytest.mark.parametrize(
    "name", ["a.npz", "a.ply", "a.spz", "a.splat", "a.usda", "a.usdz", "a.usd"]
)
def test_files_of_gaussians_are_gaussians(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    GAUSSIANS.save(path)
    start = {
        ".npz": b"PK",
        ".ply": b"ply\n",
        ".spz": b"\x1f\x8b",
        ".usda": b"#usda",
        ".usdz": b"PK",
    }
    assert path.read_bytes().startswith(start.get(path.suffix, b""))
    for loaded in (dw.load(path), dw.Gaussians.load(path)):
        assert isinstance(loaded, dw.Gaussians)
        centers = np.sort(loaded.means, axis=0)
        np.testing.assert_allclose(centers, np.sort(GAUSSIANS.means, axis=0), atol=1e-3)


def test_what_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    with pytest.raises(dw.DigsError, match=r"gone': no such file or folder"):
        dw.load(tmp_path / "gone")
    (tmp_path / "mesh.obj").write_bytes(b"v 0 0 0")
    with pytest.raises(dw.DigsError, match=r"suffix '\.obj', expected Gaussians"):
        dw.load(tmp_path / "mesh.obj")
    with pytest.raises(dw.DigsError, match=r"no gaussians\.npz in it"):
        dw.load(tmp_path)


def test_type_checkers_see_the_names_that_are_loaded() -> None:
    tree = ast.parse(inspect.getsource(digs_warp))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {
        alias.asname: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == digs_warp._HOMES


def test_every_public_name_is_there_and_documented() -> None:
    for name in digs_warp.__all__:
        value = getattr(digs_warp, name)
        assert value.__module__ == digs_warp._HOMES[name]
        assert inspect.getdoc(value)
        assert name in dir(digs_warp)


def test_settings_reach_the_options_within() -> None:
    options = with_settings(
        ReconstructionOptions(),
        {"poses": "sfm", "density": "adaptive", "iterations": 7, "voxel_size": 0.1},
    )
    config = options.reconstruct_config(seed=5)
    assert config.sfm.poses == "sfm" and config.init.voxel_size == 0.1
    assert config.train.stop.iterations == 7 and config.train.density.strategy == "adaptive"
    assert config.train.seed == config.sfm.sfm_seed == 5


def test_every_setting_has_one_name_and_seeds_have_none() -> None:
    names = setting_names(ReconstructionOptions)
    assert len(names) == len(set(names))
    assert not [name for name in names if "seed" in name]


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"iteration": 3}, "iteration: no such setting; did you mean 'iterations'"),
        ({"zzz": 3}, "zzz: no such setting; expected one of "),
        ({"density": "adaptiv"}, "density: 'adaptiv', expected one of auto, fixed"),
        ({"iterations": -1}, "iterations: -1"),
    ],
)
def test_wrong_settings_are_named(settings: dict[str, object], complaint: str) -> None:
    with pytest.raises(DigsError, match=complaint):
        with_settings(ReconstructionOptions(), settings)


def test_paths_may_be_text_and_choices_may_be_unset() -> None:
    config = with_settings(SimulateConfig(), {"mesh": "mug.glb", "environment": None})
    assert config.mesh == Path("mug.glb") and config.environment is None
