"""USD scenes as people hand them in: linear colors, packages in packages, hidden fields, no unit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

import digs_warp as dw
from digs_warp.cli import main
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.geometry.sh import C0, sh_basis, sh_from_rgb
from digs_warp.usd import names
from digs_warp.usd.reader import read_gaussians
from reference.splat_scenes import random_gaussians

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
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    for hide in ("invisible", "guide"):
        caplog.clear()
        assert len(read_gaussians(two_fields(tmp_path / f"{hide}.usda", hide))) == 20
        assert f"only {names.GAUSSIANS_PATH} is visible" in caplog.text
    path, out = two_fields(tmp_path / "a.usda"), tmp_path / "b.ply"
    for command in (["info", str(path)], ["convert", str(path), "--out", str(out)]):
        assert main(command) == 1
        assert "/Asset/Gaussians, /Asset/Old; choose one with --prim" in capsys.readouterr().err
        assert main([*command, "--prim", "/Asset/Old"]) == 0
    chosen = dw.load(path, "/Asset/Old")
    assert isinstance(chosen, Gaussians) and len(chosen) == 20


def test_a_scene_without_a_unit_is_in_centimetres_and_that_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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
