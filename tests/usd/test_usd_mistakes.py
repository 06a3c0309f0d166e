"""The validator names every mistake in a scene, wherever it hides."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from digs_warp.usd.convert import Precision
from digs_warp.usd.validate import validate
from digs_warp.usd.writer import write_gaussians
from reference.capture_scenes import splats
from reference.usd_files import SH, arrays_of, set_arrays

FIELD = "/Asset/Gaussians"

Edit = Callable[[dict[str, np.ndarray]], object]


def changed(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Edit:
    """Put what ``change`` makes of the array in its place."""
    return lambda arrays: arrays.update({name: change(arrays[name])})


def spoiled(name: str, place: int | tuple[int, int], value: float) -> Edit:
    """Write ``value`` over a row or a number of the array."""

    def edit(arrays: dict[str, np.ndarray]) -> None:
        arrays[name][place] = value

    return edit


def centers_only(arrays: dict[str, np.ndarray]) -> None:
    arrays["extent"] = np.stack([arrays["positions"].min(axis=0), arrays["positions"].max(axis=0)])


def giants(arrays: dict[str, np.ndarray]) -> None:
    arrays["scales"][:] = 5.0
    arrays["extent"] = np.array([[-20.0] * 3, [20.0] * 3])


logits = changed("opacities", lambda a: np.log(a / (1 - a)))

MISTAKES: list[tuple[Edit, str, str]] = [
    (changed("scales", np.log), "scale-range", "are these logarithms"),
    (logits, "opacity-range", "are these logits"),
    (changed("orientations", lambda q: q[:-1]), "splat-count", "49 values in 'orientations', expe"),
    (spoiled("positions", (3, 1), np.nan), "finite", "1 NaN or infinite values in 'positions'"),
    (spoiled(SH, 7, np.inf), "finite", "3 NaN or infinite values in 'radiance"),
    (centers_only, "extent", "cuts off splats"),
    (changed("extent", lambda box: box * [[0.5], [1]]), "extent", "cuts off splats"),
    (changed("extent", lambda box: box * 3), "extent", "much larger"),
    (lambda arrays: arrays.pop("extent"), "extent", "not authored"),
    (changed("orientations", lambda q: q * 1.01), "quaternion-length", "50 quaternions"),
    (spoiled("orientations", 2, 0), "quaternion-length", "1 quaternions"),
    (changed("scales", lambda s: s * (1, 1, 0)), "scale-range", "50 splats with a scale of 0"),
    (changed(SH, lambda c: c + 100), "color-range", "brightness"),
    (changed(SH, lambda c: c[: len(c) // 2]), "sh-count", "400 coefficients, expected 50 x 16"),
    (giants, "scale-range", "wider"),
]


def write_edited(path: Path, edit: Edit) -> None:
    """Write a sound scene, change its arrays through USD, save it."""
    write_gaussians(path, splats(50))
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath(FIELD)
    arrays = arrays_of(prim)
    edit(arrays)
    prim.GetAttribute("extent").Clear()
    set_arrays(prim, arrays)
    stage.Save()


def test_mistakes_in_values_are_found(tmp_path: Path):
    for number, (edit, rule, message) in enumerate(MISTAKES):
        path = tmp_path / f"scene{number}.usda"
        write_edited(path, edit)
        report = validate(path)
        found = [finding for finding in report.findings if finding.rule == rule]
        assert any(message in finding.message for finding in found), (message, report.text())
        assert all(finding.where == FIELD for finding in found)


EDITED = [
    ("elementSize = 16", "elementSize = 15", "sh-metadata", "error"),
    ('interpolation = "vertex"', 'interpolation = "varying"', "sh-metadata", "error"),
    ("sphericalHarmonicsDegree = 3", "sphericalHarmonicsDegree = 2", "sh-count", "error"),
    ("sphericalHarmonicsDegree = 3", "sphericalHarmonicsDegree = 4", "sh-degree", "error"),
    ("uniform int radiance:sphericalHarmonicsDegree = 3", "", "sh-degree", "warning"),
    ('sortingModeHint = "zDepth"', 'sortingModeHint = "random"', "hints", "error"),
    ('uniform token sortingModeHint = "zDepth"', "", "hints", "warning"),
    ('projectionModeHint = "perspective"', 'projectionModeHint = "x"', "hints", "error"),
    ('colorSpace:name = "srgb_rec709_display"', 'colorSpace:name = "x"', "color-space", "error"),
    ('uniform token colorSpace:name = "srgb_rec709_display"', "", "color-space", "warning"),
    (
        'def Xform "Asset" (',
        'def Xform "Other" ( prepend references = @../else.usda@ ) {}\ndef Xform "Asset" (',
        "asset-path",
        "error",
    ),
    (
        'def ParticleField3DGaussianSplat "Gaussians" (',
        'def ParticleField3DGaussianSplat "Second" {}\n'
        'def ParticleField3DGaussianSplat "Gaussians" (',
        "one-field",
        "warning",
    ),
]


def test_mistakes_in_the_scene_are_found(tmp_path: Path):
    write_gaussians(tmp_path / "sound.usda", splats(20))
    text = (tmp_path / "sound.usda").read_text()
    for number, (old, new, rule, severity) in enumerate(EDITED):
        assert old in text
        path = tmp_path / f"scene{number}.usda"
        path.write_text(text.replace(old, new))
        report = validate(path)
        assert (rule, severity) in {(f.rule, f.severity) for f in report.findings}, report.text()


def test_transforms_on_the_field_are_named(tmp_path: Path):
    for scale, severity in (((1, 1, 1), "warning"), ((1, 2, 1), "error")):
        path = tmp_path / f"{severity}.usda"
        write_gaussians(path, splats(20))
        stage = Usd.Stage.Open(str(path))
        field = UsdGeom.Xformable(stage.GetPrimAtPath(FIELD))
        field.AddRotateYOp().Set(30.0)
        field.AddScaleOp().Set(scale)
        stage.Save()
        found = {f.severity for f in validate(path).findings if f.rule == "transform"}
        assert found == {severity}


def test_a_mistake_in_one_variant_is_found_and_named(tmp_path: Path):
    path = tmp_path / "scene.usda"
    write_gaussians(path, splats(20))
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath(FIELD)
    opacities = prim.GetAttribute("opacities").Get()
    # Values in a variant are weaker than those on the prim itself.
    prim.GetAttribute("opacities").Clear()
    variants = prim.GetVariantSets().AddVariantSet("look")
    for name, factor in (("bad", 9.0), ("good", 1.0)):
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            prim.GetAttribute("opacities").Set([value * factor for value in opacities])
    stage.Save()
    report = validate(path)
    found = [finding for finding in report.findings if finding.rule == "opacity-range"]
    assert [finding.variants for finding in found] == ["look=bad"]
    assert report.combinations == 2


@pytest.mark.parametrize(
    ("suffix", "precision", "degree"),
    [(".usda", "mixed", 0), (".usdc", "float", 3), (".usdz", "mixed", 2)],
)
def test_what_we_write_passes(tmp_path: Path, suffix: str, precision: Precision, degree: int):
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, splats(50, degree=degree), {"psnr": 30.0}, precision)
    assert validate(path).findings == ()
    write_gaussians(path, splats(0), {}, precision)
    assert {finding.rule for finding in validate(path).findings} == {"splat-count"}


def test_packages_of_other_programs_are_judged_by_their_structure(tmp_path: Path):
    write_gaussians(tmp_path / "scene.usda", splats(5))
    path = tmp_path / "other.usdz"
    with zipfile.ZipFile(path, "w") as archive:  # no padding: members are not aligned
        archive.write(tmp_path / "scene.usda", "other.usda")
    report = validate(path)
    assert any("ByteMisalignment" in finding.rule for finding in report.findings), report.text()
    assert not report.ok
