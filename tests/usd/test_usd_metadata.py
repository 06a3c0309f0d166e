from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import CLASSIC, NO_FILTER
from digs_warp.usd.capture_scene import CaptureScene, SceneVariant
from digs_warp.usd.metadata import json_from_usd, portable_json, usd_from_json
from digs_warp.usd.reader import read_gaussians
from digs_warp.usd.writer import write_gaussians


def test_absolute_paths_are_cut_down_to_their_names():
    given = {
        "mesh": Path("/home/someone/meshes/bottle.glb"),
        "windows": "C:\\Users\\someone\\bottle.glb",
        "relative": "meshes/bottle.glb",
        "nested": {"list": ["/a/b.png", "c/d.png"]},
        "ratio": "3/4",
    }
    assert json_from_usd(usd_from_json(portable_json(given))) == {
        "mesh": "bottle.glb",
        "windows": "bottle.glb",
        "relative": "meshes/bottle.glb",
        "nested": {"list": ["b.png", "c/d.png"]},
        "ratio": "3/4",
    }


def test_numpy_values_become_plain_ones():
    given = {"psnr": np.float32(31.5), "counts": np.arange(3), "flag": np.bool_(True)}
    assert json_from_usd(usd_from_json(portable_json(given))) == {
        "psnr": 31.5,
        "counts": [0, 1, 2],
        "flag": True,
    }


def test_older_scenes_are_drawn_with_the_dilation_that_they_name(tmp_path: Path, random_gaussians):
    path = tmp_path / "scene.usdc"
    for metadata, expected in (
        ({"kernel": {"dilation_px2": 0.3, "min_alpha": 1 / 255}}, CLASSIC),
        ({"kernel": {"dilation_px2": 0.0}}, NO_FILTER),
        ({"source": "a.ply"}, NO_FILTER),
    ):
        write_gaussians(path, random_gaussians(2), metadata)
        assert read_gaussians(path).screen_filter == expected


@pytest.mark.parametrize("dilation", [1e9, "0.3"])
def test_a_dilation_that_is_none_is_refused(tmp_path: Path, random_gaussians, dilation: object):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(2), {"kernel": {"dilation_px2": dilation}})
    with pytest.raises(UsdError, match=r"dilation_px2.*expected"):
        read_gaussians(path)


def test_variants_for_different_renderers_are_refused(random_gaussians):
    ours = random_gaussians(2)
    variants = SceneVariant("a", ours), SceneVariant("b", replace(ours, screen_filter=CLASSIC))
    with pytest.raises(UsdError, match="different renderers"):
        CaptureScene(variants)


def test_text_that_only_looks_like_ours_stays_text():
    assert json_from_usd({"note": "json: see the manual"}) == {"note": "json: see the manual"}


def test_values_of_usd_that_json_does_not_know_become_text_or_lists():
    from pxr import Gf, Sdf

    read = json_from_usd({"v": Gf.Vec2f(1, 2), "a": Sdf.AssetPath("x.png")})
    assert read["v"] == [1.0, 2.0]
    assert "x.png" in read["a"]


@pytest.mark.parametrize("value", [float("nan"), {1, 2}])
def test_values_without_a_json_form_are_refused(value: object):
    with pytest.raises(UsdError, match="metadata"):
        portable_json({"bad": value})
