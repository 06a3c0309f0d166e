"""Keyword settings have the names, the choices and the checks of the flags."""

from pathlib import Path

import pytest

from digs_warp.api.settings import setting_names, with_settings
from digs_warp.checks import DigsError
from digs_warp.commands.reconstruction_options import ReconstructionOptions
from digs_warp.sim.config import SimulateConfig


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
