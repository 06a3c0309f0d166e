"""Scenes of other programs, laid out in their ways or as people hand them in, come to the same Gaussians."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Sdf, Usd, UsdGeom, UsdUtils

import digs_warp as dw
from digs_warp.checks import UsdError
from digs_warp.cli import main
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.formats.splats.files import read_splat_file
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.geometry.sh import C0, rgb_from_sh, sh_basis, sh_from_rgb
from digs_warp.usd import names
from digs_warp.usd.reader import read_gaussians
from digs_warp.usd.writer import write_gaussians
from reference.capture_scenes import splats
from reference.splat_scenes import random_gaussians
from reference.usd_files import SH, Y_UP, arrays_of, set_arrays

HALF = 2.0**-10


def y_up_arrays(tmp_path: Path, gaussians: Gaussians) -> dict[str, np.ndarray]:
    """The schema's arrays of Gaussians in a Y-up stage, as NumPy."""
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
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    return stage


def grut(tmp_path: Path, arrays: dict[str, np.ndarray]) -> Path:
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


@pytest.mark.parametrize(("layout", "rounding"), [(grut, HALF), (fvdb, 0.0), (assembled, 0.0)])
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


RGB = np.random.default_rng(0).uniform(0.05, 0.95, (20, 3))


def flat(rgb: np.ndarray) -> Gaussians:
    return replace(random_gaussians(len(rgb), 0), sh=sh_from_rgb(rgb)[:, None])


def tagged(path: Path, gaussians: Gaussians, space: str, on_attribute: bool = False) -> Path:
    """A scene whose splats have colors in another space."""
    gaussians.save(path)
    stage = Usd.Stage.Open(str(path))
    field = stage.GetPrimAtPath(names.GAUSSIANS_PATH)
    if on_attribute:
        field.GetAttribute(names.SH_COEFFICIENTS).SetColorSpace(space)
    else:
        field.GetAttribute("colorSpace:name").Set(space)
    stage.Save()
    return path


def test_colors_of_another_space_become_srgb(tmp_path: Path) -> None:
    spaces = {
        "lin_rec709_scene": 1,
        "lin_rec709_display": 1,
        "lin_srgb": 1,
        "sRGB": 0,
        "srgb_rec709_scene": 0,
        "raw": 0,
        "nobody's": 0,
    }
    for number, (space, is_linear) in enumerate(spaces.items()):
        stored = flat(linear_from_srgb(RGB) if is_linear else RGB)
        path = tagged(tmp_path / f"{number}.usda", stored, space, on_attribute=number % 2 == 1)
        colors = 0.5 + C0 * read_gaussians(path).sh[:, 0]
        np.testing.assert_allclose(colors, RGB, atol=2e-6)
    # Colors that change with the direction stay near on all sides.
    splats = flat(RGB * 0.5 + 0.25)
    sh = np.concatenate([splats.sh, np.random.default_rng(1).normal(0, 0.02, (20, 15, 3))], axis=1)
    path = tagged(tmp_path / "a.usda", replace(splats, sh=sh), "lin_rec709_scene")
    directions = np.random.default_rng(2).normal(size=(200, 3))
    basis = sh_basis(directions / np.linalg.norm(directions, axis=1, keepdims=True), 3)
    expected = srgb_from_linear(0.5 + basis @ sh)
    assert np.abs(0.5 + basis @ read_gaussians(path).sh - expected).max() < 0.01


def test_a_package_within_a_package_is_read(tmp_path: Path) -> None:
    flat(RGB).save(tmp_path / "a0.usdz")
    for depth in (1, 2):
        inner, outer = f"a{depth - 1}.usdz", tmp_path / f"a{depth}.usdz"
        root = tmp_path / f"root{depth}.usda"
        head = '#usda 1.0\n(\n    defaultPrim = "W"\n    metersPerUnit = 1\n    upAxis = "Y"\n)\n'
        root.write_text(f'{head}def Xform "W" (references = @./{inner}@) {{}}\n')
        writer = Sdf.ZipFileWriter.CreateNew(str(outer))
        writer.AddFile(str(root), root.name)
        writer.AddFile(str(tmp_path / inner), inner)
        writer.Save()
        assert len(read_gaussians(outer)) == 20


def two_fields(path: Path, hide: str = "") -> Path:
    flat(RGB).save(path)
    stage = Usd.Stage.Open(str(path))
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, names.GAUSSIANS_PATH, layer, "/Asset/Old")
    old = UsdGeom.Imageable(stage.GetPrimAtPath("/Asset/Old"))
    if hide == "invisible":
        old.MakeInvisible()
    elif hide:
        old.CreatePurposeAttr(hide)
    stage.Save()
    return path


def test_the_visible_one_of_two_fields_is_read_or_one_is_chosen_with_a_flag(
    tmp_path: Path, caplog, capsys
) -> None:
    for hide in ("invisible", "guide"):
        caplog.clear()
        assert len(read_gaussians(two_fields(tmp_path / f"{hide}.usda", hide))) == 20
        assert f"only {names.GAUSSIANS_PATH} is visible" in caplog.text
    alone = two_fields(tmp_path / "alone.usda", "invisible")
    assert len(read_gaussians(alone, "/Asset/Old")) == 20
    stage = Usd.Stage.Open(str(alone))
    stage.RemovePrim(names.GAUSSIANS_PATH)
    stage.Save()
    assert len(read_gaussians(alone)) == 20
    assert "/Asset/Old is invisible, and read all the same" in caplog.text
    (tmp_path / "lost.usda").write_text('#usda 1.0\ndef "A" (references = @./gone.usda@) {}\n')
    with pytest.raises(UsdError, match=r"no Gaussian splats \(Could not open asset .*gone\.usda"):
        read_gaussians(tmp_path / "lost.usda")
    path, out = two_fields(tmp_path / "a.usda"), tmp_path / "b.ply"
    for command in (["info", str(path)], ["convert", str(path), "--out", str(out)]):
        assert main(command) == 1
        assert "/Asset/Gaussians, /Asset/Old; choose one with --prim" in capsys.readouterr().err
        assert main([*command, "--prim", "/Asset/Old"]) == 0
    chosen = dw.load(path, "/Asset/Old")
    assert isinstance(chosen, Gaussians) and len(chosen) == 20


def test_a_scene_without_a_unit_is_in_centimetres_and_that_is_said(tmp_path: Path, capsys) -> None:
    splats, path = flat(RGB), tmp_path / "a.usda"
    splats.save(path)
    path.write_text(path.read_text().replace("metersPerUnit = 1", ""))
    for command in (["info", str(path)], ["convert", str(path), "--out", str(tmp_path / "b.npz")]):
        assert main(command) == 0
        assert "has no metersPerUnit, so it is in centimetres" in capsys.readouterr().err
    read = Gaussians.load(tmp_path / "b.npz")
    np.testing.assert_allclose(read.means, 0.01 * splats.means, rtol=1e-6)


def test_a_scene_moved_far_away_keeps_its_places(tmp_path: Path) -> None:
    splats, path = flat(RGB), tmp_path / "a.usda"
    splats.save(path)
    stage = Usd.Stage.Open(str(path))
    stage.SetMetadata("customLayerData", {})
    asset = UsdGeom.Xformable(stage.GetPrimAtPath(names.ASSET_PATH))
    asset.AddTranslateOp().Set((431000.25, 312.5, -4582000.125))
    stage.Save()
    read = read_gaussians(path)
    assert read.world_offset is not None and np.abs(read.means).max() < 10
    places = read.means + np.array(read.world_offset)
    np.testing.assert_allclose(places, splats.means + (431000.25, 4582000.125, 312.5), atol=1e-6)
