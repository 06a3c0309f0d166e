"""What the writer puts into a scene, the bytes it leaves, and what it refuses."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Gf, Usd, UsdGeom, UsdVol

from digs_warp.checks import UsdError
from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.usd import files
from digs_warp.usd.writer import write_gaussians
from reference.fresh_process import run_fresh
from reference.full_disk import largest_file
from reference.splat_files import random_gaussians
from reference.usd_files import Y_UP


def field_of(path: Path):
    stage = Usd.Stage.Open(str(path))
    return stage, stage.GetPrimAtPath("/Asset/Gaussians")


def values(path: Path, name: str) -> np.ndarray:
    _stage, field = field_of(path)
    return np.array(field.GetAttribute(name).Get())


def test_stage_is_a_metric_y_up_component_with_one_typed_field(tmp_path: Path):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(5))
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert stage.HasAuthoredMetadata("metersPerUnit")
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    asset = stage.GetDefaultPrim()
    assert str(asset.GetPath()) == "/Asset"
    assert Usd.ModelAPI(asset).GetKind() == "component"
    fields = [prim for prim in stage.TraverseAll() if prim.IsA(UsdVol.ParticleField)]
    assert [str(prim.GetPath()) for prim in fields] == ["/Asset/Gaussians"]
    assert fields[0].IsA(UsdVol.ParticleField3DGaussianSplat)
    in_stage = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(fields[0]))
    assert_array_equal(in_stage, np.eye(4))
    recorded = asset.GetCustomDataByKey("digs_warp:sourceToAsset")
    # Gf matrices act on row vectors.
    assert_array_equal(np.array(recorded)[:3, :3], Y_UP.T)


@pytest.mark.parametrize(
    ("count", "precision", "half"), [(40_000, "float", ""), (500, "mixed", "h")]
)
def test_extent_contains_the_three_sigma_box_of_every_splat_and_no_more(
    tmp_path: Path, count: int, precision, half: str
):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(count), precision=precision)
    quats = values(path, f"orientations{half}")
    assert (quats[:, 3] >= 0).all()
    # An independent way: the support function of the stored ellipsoids, in float64.
    rotations = matrix_from_quat_xyzw(quats)
    scales = values(path, f"scales{half}").astype(np.float64)
    centers = values(path, "positions").astype(np.float64)
    low, high = values(path, "extent").astype(np.float64)
    for axis in range(3):
        reach = 3 * np.linalg.norm(rotations[:, axis, :] * scales, axis=1)
        assert (centers[:, axis] - reach >= low[axis]).all()
        assert (centers[:, axis] + reach <= high[axis]).all()
        assert_allclose(low[axis], (centers[:, axis] - reach).min(), rtol=1e-6)
        assert_allclose(high[axis], (centers[:, axis] + reach).max(), rtol=1e-6)
        # The box of the centers alone would cut splats off.
        assert low[axis] < centers[:, axis].min() - 1e-3


def test_color_spaces_resolve_to_srgb_and_linear(tmp_path: Path):
    path = tmp_path / "scene.usdc"
    gaussians = random_gaussians(2, degree=1)
    gaussians.sh[:, 0] = sh_from_rgb(np.array([[0.9, 0.5, 0.1], [0.1, 0.5, 0.9]]))
    gaussians.opacity_logits[:] = (30.0, -30.0)  # the second splat is invisible
    write_gaussians(path, gaussians)
    _stage, field = field_of(path)
    cache = Usd.ColorSpaceHashCache()
    assert Usd.ColorSpaceAPI.ComputeColorSpaceName(field, cache) == "srgb_rec709_display"
    space = Usd.ColorSpaceAPI.ComputeColorSpace(field, cache)
    encoded = np.array([0.01, 0.2, 0.9])
    linear = Gf.ColorSpace("lin_rec709_scene").Convert(space, Gf.Vec3f(*encoded)).GetRGB()
    assert_allclose(linear, linear_from_srgb(encoded), atol=1e-4)
    # displayColor is the mean by opacity, and linear, whatever the splats are.
    color = field.GetAttribute("primvars:displayColor")
    assert_allclose(np.array(color.Get()), linear_from_srgb(np.array([[0.9, 0.5, 0.1]])), atol=1e-5)
    assert Usd.ColorSpaceAPI.ComputeColorSpaceName(color, cache) == "lin_rec709_scene"


def test_nan_and_infinite_splats_are_refused_with_their_number(tmp_path: Path):
    for name in ("means", "opacity_logits"):
        gaussians = random_gaussians(20)
        getattr(gaussians, name)[[3, 7]] = np.nan
        with pytest.raises(UsdError, match=r"2 of 20 splats hold NaN.*first is number 3"):
            write_gaussians(tmp_path / "scene.usdc", gaussians)
    assert list(tmp_path.iterdir()) == []


def test_same_input_gives_the_same_bytes_in_another_process(tmp_path: Path):
    gaussians = random_gaussians(300)
    gaussians.save(tmp_path / "gaussians.npz")
    metadata = {"b": 1, "a": {"d": [1.5], "c": "text"}}
    write_gaussians(tmp_path / "here.usdz", gaussians, metadata)
    # Another time zone: packages must not carry local times.
    run_fresh(
        "from pathlib import Path; from digs_warp.data.gaussians import Gaussians\n"
        "from digs_warp.usd.writer import write_gaussians\n"
        f"folder = Path({str(tmp_path)!r}); gaussians = Gaussians.load(folder / 'gaussians.npz')\n"
        f"write_gaussians(folder / 'there.usdz', gaussians, {metadata!r})\n",
        TZ="Asia/Tokyo",
    )
    assert (tmp_path / "here.usdz").read_bytes() == (tmp_path / "there.usdz").read_bytes()


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
def test_a_write_that_runs_out_of_space_leaves_the_old_file(tmp_path: Path, suffix: str):
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, random_gaussians(3))
    before = path.read_bytes()
    with largest_file(100_000), pytest.raises(UsdError, match=rf"scene\{suffix}.*too large"):
        write_gaussians(path, random_gaussians(2000))
    assert path.read_bytes() == before
    assert [*tmp_path.iterdir()] == [path]


def test_what_cannot_be_written_is_refused_and_leaves_nothing(tmp_path: Path, monkeypatch):
    with pytest.raises(UsdError, match=r"expected one of \.usda, \.usdc, \.usdz"):
        write_gaussians(tmp_path / "scene", random_gaussians(1))
    monkeypatch.setattr(files, "MAX_PACKAGE", 1000)
    with pytest.raises(UsdError, match=r"scene.usdz': \d+ bytes do not fit.*write a \.usdc"):
        write_gaussians(tmp_path / "scene.usdz", random_gaussians(100))
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "scene.usdc").mkdir()
    with pytest.raises(UsdError, match=r"scene\.usdc.*cannot be written"):
        write_gaussians(tmp_path / "scene.usdc", random_gaussians(1))
    assert [path.name for path in tmp_path.iterdir()] == ["scene.usdc"]
