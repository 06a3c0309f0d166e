from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import CLASSIC, NO_FILTER
from digs_warp.usd.metadata import portable_json
from digs_warp.usd.reader import read_gaussians, read_scene
from digs_warp.usd.writer import write_gaussians

AS_IT_IS: dict[str, Any] = {
    "settings": {"iterations": 1000, "dilation [px]": 0.3, "mask": True, "name": "größe"},
    "views": [{"name": "0007", "psnr": 31.25}, {"name": "0015", "psnr": None}],
    "empty": [],
    "none at all": {},
    "seed": 2**63,
    "paths": ["meshes/bottle.glb", "3/4"],
}
CHANGED = {
    "mesh": (Path("/home/someone/meshes/bottle.glb"), "bottle.glb"),
    "windows": ("C:\\Users\\someone\\bottle.glb", "bottle.glb"),
    "nested": ({"list": ["/a/b.png", "c/d.png"]}, {"list": ["b.png", "c/d.png"]}),
    "numbers": ({"a": np.float32(31.5), "b": np.arange(3)}, {"a": 31.5, "b": [0, 1, 2]}),
}


@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_metadata_comes_back_without_the_folders_of_this_machine(
    tmp_path: Path, random_gaussians, suffix: str
):
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, random_gaussians(1), AS_IT_IS | {k: v for k, (v, _) in CHANGED.items()})
    read = read_scene(path).metadata
    assert read.pop("version")
    assert read == AS_IT_IS | {k: v for k, (_, v) in CHANGED.items()}


def test_scenes_are_drawn_with_the_dilation_that_they_name(
    tmp_path: Path, random_gaussians, caplog: pytest.LogCaptureFixture
):
    path = tmp_path / "scene.usdc"
    for metadata, expected in (
        ({"kernel": {"dilation_px2": 0.3, "min_alpha": 1 / 255}}, CLASSIC),
        ({"kernel": {"dilation_px2": 0.0}}, NO_FILTER),
        ({"source": "a.ply"}, NO_FILTER),
    ):
        write_gaussians(path, random_gaussians(2), metadata)
        assert read_gaussians(path).screen_filter == expected
    assert not caplog.text
    write_gaussians(path, replace(random_gaussians(2), screen_filter=CLASSIC))
    assert "widen them by 0.3 px^2" in caplog.text
    assert read_gaussians(path).screen_filter == CLASSIC
    for dilation in (1e9, "0.3"):
        write_gaussians(path, random_gaussians(2), {"kernel": {"dilation_px2": dilation}})
        with pytest.raises(UsdError, match=r"dilation_px2.*expected"):
            read_gaussians(path)


def test_values_without_a_json_form_are_refused():
    for value in (float("nan"), {1, 2}):
        with pytest.raises(UsdError, match="metadata"):
            portable_json({"bad": value})
