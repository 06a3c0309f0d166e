import json
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from digs_warp.checks import UsdError
from digs_warp.record.files import to_json
from digs_warp.usd.reader import describe
from digs_warp.usd.writer import write_gaussians


@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_facts_agree_with_what_was_written(tmp_path: Path, random_gaussians, suffix: str):
    gaussians = random_gaussians(30, degree=2)
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, gaussians, {"psnr": 31.5})
    facts = describe(path)
    assert facts["splats"] == 30
    assert facts["sh_degree"] == 2
    assert facts["up_axis"] == "Y"
    assert facts["meters_per_unit"] == 1.0
    assert facts["bytes"] == path.stat().st_size
    assert facts["prim_path"] == "/Asset/Gaussians"
    assert facts["metadata"]["psnr"] == 31.5
    # The box reaches beyond the centers by at most three of the largest standard deviation.
    low, high = facts["extent"]
    reach = 3.001 * gaussians.scales.max()
    in_asset = gaussians.means[:, [0, 2, 1]] * (1, 1, -1)
    assert (low < in_asset.min(axis=0)).all()
    assert (high > in_asset.max(axis=0)).all()
    assert_allclose(low, in_asset.min(axis=0), atol=reach)
    assert_allclose(high, in_asset.max(axis=0), atol=reach)
    assert json.loads(to_json(facts))["splats"] == 30


def test_a_scene_without_splats_has_no_extent(tmp_path: Path, random_gaussians):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(0, degree=1))
    facts = describe(path)
    assert (facts["splats"], facts["sh_degree"], facts["extent"]) == (0, 1, None)


def test_a_file_that_is_no_scene_is_an_error(tmp_path: Path):
    (tmp_path / "scene.usdz").write_bytes(b"PK")
    with pytest.raises(UsdError, match=r"scene\.usdz"):
        describe(tmp_path / "scene.usdz")
