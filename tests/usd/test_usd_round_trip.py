from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from digs_warp.gaussians import Gaussians
from digs_warp.geometry import matrix_from_quat_xyzw
from usd.reader import read_gaussians, read_scene
from usd.writer import write_gaussians

# Half a step of float32 at 1, relative.
EPS = 2.0**-24

SUFFIXES = (".usda", ".usdc", ".usdz")


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


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("degree", range(4))
@pytest.mark.parametrize("count", [0, 1, 1000])
def test_what_is_written_is_read(
    tmp_path: Path, random_gaussians, suffix: str, degree: int, count: int
):
    gaussians = random_gaussians(count, degree)
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, gaussians)
    assert_same(read_gaussians(path), gaussians)


def test_a_second_round_trip_changes_nothing_but_rounding(tmp_path: Path, random_gaussians):
    first, second = tmp_path / "first.usdc", tmp_path / "second.usdc"
    write_gaussians(first, random_gaussians(100))
    once = read_gaussians(first)
    write_gaussians(second, once)
    assert_same(read_gaussians(second), once)


def test_a_zero_quaternion_is_no_rotation_in_our_world(tmp_path: Path, random_gaussians):
    gaussians = random_gaussians(3)
    gaussians.quats[1] = 0.0
    path = tmp_path / "scene.usdc"
    write_gaussians(path, gaussians)
    assert_allclose(read_gaussians(path).quats[1], (0, 0, 0, 1), atol=4 * EPS)


def test_huge_and_tiny_quaternions_keep_their_rotation(tmp_path: Path, random_gaussians):
    gaussians = random_gaussians(2)
    gaussians.quats[0] *= 1e30
    gaussians.quats[1] *= 1e-30
    path = tmp_path / "scene.usdc"
    write_gaussians(path, gaussians)
    assert_allclose(
        matrix_from_quat_xyzw(read_gaussians(path).quats),
        matrix_from_quat_xyzw(gaussians.quats),
        atol=16 * EPS,
    )


def test_extreme_opacities_and_scales_come_back_finite(tmp_path: Path, random_gaussians):
    gaussians = random_gaussians(4)
    gaussians.opacity_logits[:] = (-1000.0, -50.0, 50.0, 1000.0)
    gaussians.log_scales[0] = -100.0
    path = tmp_path / "scene.usdc"
    write_gaussians(path, gaussians)
    read = read_gaussians(path)
    assert np.isfinite(read.opacity_logits).all()
    assert_allclose(read.opacities, (0, 0, 1, 1), atol=2 * EPS)
    assert_allclose(read.scales[0], 1e-12, rtol=1e-5)


def test_writing_over_a_file_that_was_read_is_seen_by_the_next_read(
    tmp_path: Path, random_gaussians
):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(10, seed=1))
    first = read_gaussians(path)
    write_gaussians(path, random_gaussians(20, seed=2))
    assert (len(first), len(read_gaussians(path))) == (10, 20)
    assert_array_equal(first.means, random_gaussians(10, seed=1).means)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_metadata_comes_back_as_it_was(tmp_path: Path, random_gaussians, suffix: str):
    metadata = {
        "settings": {"iterations": 1000, "dilation [px]": 0.3, "mask": True, "name": "größe"},
        "counts": [1, 2, 3],
        "psnr": [31.5, 32.0],
        "stages": ["init", "train"],
        "views": [{"name": "0007", "psnr": 31.25}, {"name": "0015", "psnr": None}],
        "nothing": None,
        "empty": [],
        "none at all": {},
        "seed": 2**63,
        "negative": -(2**40),
        "switches": [True, False],
    }
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, random_gaussians(1), metadata)
    read = read_scene(path).metadata
    assert read.pop("version")
    assert read == metadata
