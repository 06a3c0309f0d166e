"""Files laid out as other exporters lay theirs out come to the same Gaussians.

The layouts: 3dgrut (features half, a package of layers), fVDB (Z-up data turned by a transform), Isaac Sim (a
material is bound), and one assembled from the schema's parts; none has metadata on the coefficients.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import srgb_from_linear
from digs_warp.formats.splats.files import read_splat_file
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.geometry.sh import rgb_from_sh
from digs_warp.usd.reader import read_gaussians
from digs_warp.usd.writer import write_gaussians
from reference.capture_scenes import splats
from reference.usd_files import SH, Y_UP, arrays_of, set_arrays

HALF = 2.0**-10


def y_up_arrays(tmp_path: Path, gaussians: Gaussians) -> dict[str, np.ndarray]:
    """The schema's arrays of Gaussians in a Y-up stage, as NumPy."""
    from pxr import Usd

    write_gaussians(tmp_path / "source.usdc", gaussians)
    stage = Usd.Stage.Open(str(tmp_path / "source.usdc"))
    return arrays_of(stage.GetPrimAtPath("/Asset/Gaussians"))


def author(stage, path: str, arrays: dict[str, np.ndarray], half: tuple[str, ...] = ()):
    """Author a field without any metadata on its coefficients."""
    prim = stage.DefinePrim(path, "ParticleField3DGaussianSplat")
    set_arrays(prim, arrays, half)
    count = len(arrays[SH]) // len(arrays["positions"])
    prim.GetAttribute("radiance:sphericalHarmonicsDegree").Set(round(count**0.5) - 1)
    return prim


def new_stage(path: Path, up: str = "Y", metres: float = 1.0):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    return stage


def grut(tmp_path: Path, arrays: dict[str, np.ndarray]) -> Path:
    from pxr import Sdf, Usd, UsdUtils

    parts = new_stage(tmp_path / "gaussians.usdc")
    prim = author(parts, "/Gaussians", arrays, half=("orientations", SH))
    parts.SetDefaultPrim(prim)
    prim.GetAttribute("sortingModeHint").Set("cameraDistance")
    prim.CreateAttribute("colorSpace:name", Sdf.ValueTypeNames.Token).Set("srgb_rec709_display")
    parts.Save()
    stage = new_stage(tmp_path / "default.usda")
    world = stage.DefinePrim("/World", "Xform")
    stage.SetDefaultPrim(world)
    stage.DefinePrim("/World/Gaussians").GetReferences().AddReference("./gaussians.usdc")
    stage.DefinePrim("/World/Camera", "Camera")
    stage.Save()
    path = tmp_path / "scene.usdz"
    assert Usd.Stage.Open(str(tmp_path / "default.usda"))
    UsdUtils.CreateNewUsdzPackage(str(tmp_path / "default.usda"), str(path), "default.usda")
    return path


def fvdb(tmp_path: Path, arrays: dict[str, np.ndarray]) -> Path:
    """The values stay in the data's own frame (z up); a transform turns them upright."""
    from pxr import UsdGeom

    z_up = dict(arrays)
    z_up["positions"] = arrays["positions"] @ Y_UP
    plain = splats(len(arrays["positions"]), 7)
    z_up["orientations"], z_up[SH] = plain.quats, plain.sh.reshape(-1, 3)
    stage = new_stage(tmp_path / "scene.usdc")
    root = UsdGeom.Xform.Define(stage, "/World")
    root.AddRotateXOp().Set(-90.0)
    author(stage, "/World/gaussians", z_up)
    stage.SetDefaultPrim(root.GetPrim())
    stage.Save()
    return tmp_path / "scene.usdc"


def assembled(tmp_path: Path, arrays: dict[str, np.ndarray]) -> Path:
    """Assembled from parts: a plain ParticleField with the kernel of ellipsoids; no degree is authored."""
    stage = new_stage(tmp_path / "scene.usda")
    stage.SetDefaultPrim(author(stage, "/splats", arrays))
    stage.Save()
    text = (tmp_path / "scene.usda").read_text()
    text = text.replace(
        'def ParticleField3DGaussianSplat "splats"',
        'def ParticleField "splats" (\n    prepend apiSchemas = ['
        '"ParticleFieldPositionAttributeAPI", "ParticleFieldOrientationAttributeAPI", '
        '"ParticleFieldScaleAttributeAPI", "ParticleFieldOpacityAttributeAPI", '
        '"ParticleFieldKernelGaussianEllipsoidAPI", '
        '"ParticleFieldSphericalHarmonicsAttributeAPI"]\n)',
    ).replace("uniform int radiance:sphericalHarmonicsDegree = 3", "")
    (tmp_path / "assembled.usda").write_text(text)
    return tmp_path / "assembled.usda"


def isaac(tmp_path: Path, arrays: dict[str, np.ndarray]) -> Path:
    """As Isaac Sim saves a scene: an emissive material in MDL is bound to the splats."""
    from pxr import UsdShade

    stage = new_stage(tmp_path / "scene.usda")
    prim = author(stage, "/World/splats", arrays)
    material = UsdShade.Material.Define(stage, "/World/Looks/emissive")
    shader = UsdShade.Shader.Define(stage, "/World/Looks/emissive/Shader")
    shader.SetSourceAsset("ParticleFieldEmissive.mdl", "mdl")
    shader.SetSourceAssetSubIdentifier("ParticleFieldEmissive", "mdl")
    material.CreateSurfaceOutput("mdl").ConnectToSource(shader.ConnectableAPI(), "out")
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)
    stage.Save()
    return tmp_path / "scene.usda"


@pytest.mark.parametrize(
    ("layout", "rounding"),
    [
        (isaac, 0.0),
        (grut, HALF),
        (fvdb, 0.0),
        (assembled, 0.0),
    ],
)
def test_layouts_of_other_exporters_are_read(
    tmp_path: Path, layout: Callable[[Path, dict[str, np.ndarray]], Path], rounding: float
):
    gaussians = splats(30, 7)
    read = read_gaussians(layout(tmp_path, y_up_arrays(tmp_path, gaussians)))
    assert_allclose(read.means, gaussians.means, atol=1e-7)
    assert_allclose(read.log_scales, gaussians.log_scales, atol=2e-6)
    assert_allclose(read.opacities, gaussians.opacities, atol=1e-6)
    turns = matrix_from_quat_xyzw(read.quats), matrix_from_quat_xyzw(gaussians.quats)
    assert_allclose(*turns, atol=2e-6 + 4 * rounding)
    assert_allclose(read.sh, gaussians.sh, atol=2e-6 + 4 * rounding)


@pytest.mark.parametrize("space", ["", "lin_rec709_scene"])
@pytest.mark.parametrize("one_for_all", [True, False])
def test_a_field_without_coefficients_has_its_display_colors(tmp_path, one_for_all, space, caplog):
    """As Houdini writes it; displayColor is linear, whatever space is said of the splats."""
    from pxr import Sdf

    gaussians = splats(30, 7)
    stage = new_stage(tmp_path / "scene.usdc")
    prim = author(stage, "/splats", y_up_arrays(tmp_path, gaussians))
    prim.GetAttribute(SH).Block()
    colors = np.random.default_rng(3).random((1 if one_for_all else 30, 3))
    prim.GetAttribute("primvars:displayColor").Set(colors.astype(np.float32))
    if space:
        prim.CreateAttribute("colorSpace:name", Sdf.ValueTypeNames.Token).Set(space)
    stage.Save()
    read = read_gaussians(tmp_path / "scene.usdc")
    shown = rgb_from_sh(read.sh, np.tile([0.0, 0.0, 1.0], (30, 1)))
    assert_allclose(shown, np.broadcast_to(srgb_from_linear(colors), (30, 3)), atol=1e-6)
    assert "drawn with primvars:displayColor" in caplog.text


def test_what_another_converter_made_of_a_ply_is_what_we_read_from_it():
    """eight.usda is what usd-convert-gsplat 0.1.15 wrote for eight.ply; it takes the values for Y-up."""
    data = Path(__file__).parent / "data"
    theirs = read_gaussians(data / "eight.usda")
    ours = read_splat_file(data / "eight.ply", up="y")
    assert len(theirs) == 8
    assert_array_equal(theirs.means, ours.means)
    assert_allclose(theirs.log_scales, ours.log_scales, atol=2e-6)
    assert_allclose(theirs.opacities, ours.opacities, atol=1e-7)
    turns = matrix_from_quat_xyzw(theirs.quats), matrix_from_quat_xyzw(ours.quats)
    assert_allclose(*turns, atol=1e-6)
    assert_allclose(theirs.sh, ours.sh, atol=1e-6)
