"""Gaussians and metadata that are written come back."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import CLASSIC, NO_FILTER, Gaussians
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.usd.metadata import portable_json
from digs_warp.usd.reader import describe, read_gaussians, read_scene
from digs_warp.usd.writer import write_gaussians
from reference.splat_files import random_gaussians

# Half a step of float32 at 1, relative.
EPS = 2.0**-24


def assert_same(read: Gaussians, written: Gaussians) -> None:
    assert len(read) == len(written)
    assert read.sh_degree == written.sh_degree
    # The way to Y-up and back only swaps axes and signs: exact.
    assert_array_equal(read.means, written.means)
    # exp and log: an error of EPS in the scale is EPS in its logarithm, plus rounding at up to 8.
    assert_allclose(read.log_scales, written.log_scales, rtol=0, atol=16 * EPS)
    # Opacities are stored as float32; logits lose digits where the logistic function is flat.
    assert_allclose(read.opacities, written.opacities, rtol=0, atol=4 * EPS)
    assert_allclose(
        matrix_from_quat_xyzw(read.quats), matrix_from_quat_xyzw(written.quats), atol=16 * EPS
    )
    # Bands 0 and 1 of a quarter turn swap axes and signs; bands 2 and 3 mix up to 7 coefficients.
    assert_array_equal(read.sh[:, :4], written.sh[:, :4])
    assert_allclose(read.sh, written.sh, rtol=0, atol=32 * EPS)


@pytest.mark.parametrize(
    ("suffix", "count", "degree"), [(".usda", 1000, 2), (".usdc", 0, 3), (".usdz", 1000, 0)]
)
def test_what_is_written_is_read(tmp_path: Path, suffix: str, degree: int, count: int):
    gaussians = random_gaussians(count, degree)
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, gaussians)
    assert_same(read_gaussians(path), gaussians)
    facts = describe(path)
    assert [facts[name] for name in ("splats", "sh_degree")] == [count, degree]
    assert facts["bytes"] == path.stat().st_size
    assert (facts["extent"] is None) == (count == 0)


def test_extreme_values_come_back_finite(tmp_path: Path):
    gaussians = random_gaussians(4)
    gaussians.opacity_logits[:] = (-1000.0, -50.0, 50.0, 1000.0)
    gaussians.log_scales[0] = -100.0
    gaussians.quats[2] = 0.0  # no rotation
    gaussians.quats[0] *= 1e30
    gaussians.quats[1] *= 1e-30
    path = tmp_path / "scene.usdc"
    write_gaussians(path, gaussians)
    read = read_gaussians(path)
    assert np.isfinite(read.opacity_logits).all()
    assert_allclose(read.opacities, (0, 0, 1, 1), atol=2 * EPS)
    assert_allclose(read.scales[0], 1e-12, rtol=1e-5)
    assert_allclose(read.quats[2], (0, 0, 0, 1), atol=4 * EPS)
    turns = matrix_from_quat_xyzw(read.quats[:2]), matrix_from_quat_xyzw(gaussians.quats[:2])
    assert_allclose(*turns, atol=16 * EPS)


def test_writing_over_a_file_that_was_read_is_seen_by_the_next_read(tmp_path: Path):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(10, seed=1))
    first = read_gaussians(path)
    write_gaussians(path, random_gaussians(20, seed=2))
    assert (len(first), len(read_gaussians(path))) == (10, 20)
    assert_array_equal(first.means, random_gaussians(10, seed=1).means)


# Half a step of float16 at 1, relative.
HALF_EPS = 2.0**-11


@pytest.mark.parametrize(("count", "degree"), [(0, 0), (1000, 3)])
def test_halves_are_read_to_their_rounding(tmp_path: Path, count: int, degree: int):
    gaussians = random_gaussians(count, degree)
    gaussians.log_scales[:1] = -30.0  # below what a half holds
    path = tmp_path / "scene.usdz"
    write_gaussians(path, gaussians, precision="mixed")
    read = read_gaussians(path)
    assert (len(read), read.sh_degree) == (count, degree)
    assert describe(path)["precision"] == ("mixed" if count else "float")
    assert_array_equal(read.means, gaussians.means)
    # Below 6e-5 halves have fewer digits, down to a step of 6e-8, and none becomes 0.
    smallest = np.maximum(gaussians.scales, 2.0**-24)
    assert_allclose(read.scales, smallest, rtol=HALF_EPS, atol=3.1e-8)
    assert_allclose(read.opacities, gaussians.opacities, rtol=HALF_EPS + 1e-6, atol=1e-7)
    turns = matrix_from_quat_xyzw(read.quats), matrix_from_quat_xyzw(gaussians.quats)
    assert_allclose(*turns, atol=8 * HALF_EPS)
    largest = np.abs(gaussians.sh).max(initial=1.0)
    assert_allclose(read.sh, gaussians.sh, atol=2 * HALF_EPS * largest)


def test_values_beyond_half_precision_are_refused_by_name(tmp_path: Path):
    gaussians = random_gaussians(3)
    gaussians.sh[1] = 70000.0
    with pytest.raises(UsdError, match=r"sh beyond 65504.*'float'"):
        write_gaussians(tmp_path / "scene.usdc", gaussians, precision="mixed")
    assert list(tmp_path.iterdir()) == []


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
def test_metadata_comes_back_without_the_folders_of_this_machine(tmp_path: Path, suffix: str):
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, random_gaussians(1), AS_IT_IS | {k: v for k, (v, _) in CHANGED.items()})
    read = read_scene(path).metadata
    assert read.pop("version")
    assert read == AS_IT_IS | {k: v for k, (_, v) in CHANGED.items()}


def test_scenes_are_drawn_with_the_dilation_that_they_name(tmp_path: Path, caplog):
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
