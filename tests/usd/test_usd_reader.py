import logging
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from digs_warp.checks import UsdError
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.geometry.sh import rgb_from_sh
from digs_warp.usd.reader import read_gaussians, read_scene
from digs_warp.usd.writer import write_gaussians
from reference.splat_files import random_gaussians

HALF_EPS = 2.0**-11

# Two splats as another program might write them: no type, half precision, centimetres, and a parent
# that turns by 90 degrees about the stage's y axis, doubles and moves. The first splat lies on x.
FOREIGN = """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Xform "Root"
{
    double3 xformOp:translate = (0, 10, 0)
    double xformOp:rotateY = 90
    double3 xformOp:scale = (2, 2, 2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY", "xformOp:scale"]

    def "Splats"
    {
        point3h[] positionsh = [(1, 0, 0), (0, 3, 0)]
        quath[] orientationsh = [(1, 0, 0, 0), (0.5, 0.5, 0.5, 0.5)]
        half3[] scalesh = [(0.5, 0.25, 0.125), (1, 2, 4)]
        half[] opacitiesh = [0.5, 1]
        uniform int radiance:sphericalHarmonicsDegree = 1
        half3[] radiance:sphericalHarmonicsCoefficientsh = [
            (0.5, 0.25, 0), (0.5, 0, 0), (0, 0, 0), (0, 0.25, 0),
            (0, 0, 0), (0, 0, 0), (0, 0.5, 0), (0, 0, 0)]
    }
}
"""


def scene(tmp_path: Path, body: str, header: str = 'metersPerUnit = 1\n    upAxis = "Z"') -> Path:
    path = tmp_path / "scene.usda"
    path.write_text(f"#usda 1.0\n(\n    {header}\n)\n{body}")
    return path


def field(inside: str, name: str = "G") -> str:
    return f'def ParticleField3DGaussianSplat "{name}"\n{{\n{inside}\n}}\n'


def test_untyped_half_precision_splats_under_a_transform_come_to_our_world(tmp_path: Path):
    path = tmp_path / "foreign.usda"
    path.write_text(FOREIGN)
    gaussians = read_gaussians(path)
    # By hand. Stage: (1, 0, 0) turned about y is (0, 0, -1), doubled, raised by 10 -> (0, 10, -2);
    # our world: (x, -z, y) in metres.
    assert_allclose(gaussians.means, [(0, 0.02, 0.10), (0, 0, 0.16)], atol=1e-7)
    assert_allclose(
        gaussians.scales, 0.02 * np.array([(0.5, 0.25, 0.125), (1, 2, 4)]), rtol=HALF_EPS
    )
    assert_allclose(gaussians.opacities, (0.5, 1.0), atol=1e-7)
    # Local x goes to the stage's -z, that is our y; local y goes up; local z to the stage's x.
    world_from_local = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    assert_allclose(matrix_from_quat_xyzw(gaussians.quats[0]), world_from_local, atol=1e-6)
    cycle = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])  # wxyz (.5, .5, .5, .5): x -> y -> z -> x
    assert_allclose(matrix_from_quat_xyzw(gaussians.quats[1]), world_from_local @ cycle, atol=1e-6)
    directions = np.random.default_rng(0).normal(size=(2, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    local_sh = np.array(
        [
            [(0.5, 0.25, 0), (0.5, 0, 0), (0, 0, 0), (0, 0.25, 0)],
            [(0, 0, 0), (0, 0, 0), (0, 0.5, 0), (0, 0, 0)],
        ]
    )
    assert_allclose(
        rgb_from_sh(gaussians.sh, directions),
        rgb_from_sh(local_sh, directions @ world_from_local),
        atol=1e-6,
    )


def test_float_is_preferred_unless_it_is_empty(tmp_path: Path):
    body = field(
        """point3f[] positions = [(1, 2, 3)]
        point3h[] positionsh = [(9, 9, 9), (9, 9, 9)]
        float[] opacities = []
        half[] opacitiesh = [0.25]
        quath[] orientationsh = [(0, 1, 0, 0)]
        uniform int radiance:sphericalHarmonicsDegree = 0
        float3[] radiance:sphericalHarmonicsCoefficients = []
        half3[] radiance:sphericalHarmonicsCoefficientsh = [(1, 0.5, 0)]"""
    )
    gaussians = read_gaussians(scene(tmp_path, body))
    assert_array_equal(gaussians.means, [(1, 2, 3)])
    assert_allclose(gaussians.opacities, 0.25)
    assert_allclose(gaussians.quats, [(1, 0, 0, 0)], atol=1e-7)
    assert_allclose(gaussians.sh, [[(1, 0.5, 0)]])
    # Absent attributes have the defaults of the schema.
    gaussians = read_gaussians(scene(tmp_path, field("point3f[] positions = [(1, 2, 3)]")))
    assert_allclose(gaussians.scales, 1.0)
    assert_allclose(gaussians.opacities, 1.0, atol=1e-7)
    assert np.isfinite(gaussians.opacity_logits).all()
    assert_allclose(gaussians.quats, [(0, 0, 0, 1)])
    assert_allclose(rgb_from_sh(gaussians.sh, np.array([[0, 0, 1.0]])), 0.5)


@pytest.mark.parametrize(("stored", "kept"), [(4, 4), (25, 16)])
def test_degree_follows_the_array_where_they_disagree(
    tmp_path: Path, caplog, stored: int, kept: int
):
    degree = 2
    triplets = ", ".join(f"({i}, 0, 0)" for i in range(2 * stored))
    body = field(
        f"""point3f[] positions = [(0, 0, 0), (1, 1, 1)]
        uniform int radiance:sphericalHarmonicsDegree = {degree}
        float3[] radiance:sphericalHarmonicsCoefficients = [{triplets}]"""
    )
    with caplog.at_level(logging.WARNING):
        gaussians = read_gaussians(scene(tmp_path, body))
    assert f"the SH degree is {degree}" in caplog.text
    expected = np.arange(2.0 * stored).reshape(2, stored)[:, :kept]
    assert_allclose(gaussians.sh[..., 0], expected, atol=1e-5)


def test_arrays_of_a_wrong_length_are_cut_or_ignored_with_a_warning(tmp_path: Path, caplog):
    body = field(
        """point3f[] positions = [(0, 0, 0), (1, 1, 1)]
        float[] opacities = [0.25, 0.5, 0.75]
        float3[] scales = [(2, 2, 2)]
        float3[] radiance:sphericalHarmonicsCoefficients = [(1, 1, 1), (1, 1, 1), (1, 1, 1)]"""
    )
    with caplog.at_level(logging.WARNING):
        gaussians = read_gaussians(scene(tmp_path, body))
    assert_allclose(gaussians.opacities, (0.25, 0.5))
    assert_allclose(gaussians.scales, 1.0)
    assert_allclose(gaussians.sh, 0.0)
    for message in ("3 opacities for 2 splats", "1 scales for 2 splats", "fit no degree"):
        assert message in caplog.text


def test_several_fields_are_listed_and_one_can_be_chosen(tmp_path: Path):
    one, two = (f"point3f[] positions = [({x}, 0, 0)]" for x in (1, 2))
    path = scene(tmp_path, field(one, "A") + field(two, "B"))
    chosen = read_scene(path, "/B")
    assert_allclose(chosen.gaussians.means, [(2, 0, 0)])
    assert chosen.prim_path == "/B"
    for wrong in (None, "/C", "B", "not a path", ""):
        with pytest.raises(UsdError, match=r"found.*: /A, /B"):
            read_gaussians(path, wrong)


ONE = "point3f[] positions = [(0, 0, 0)]\n"


def moved(x_axis: str) -> str:
    rows = f"(({x_axis}, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
    order = 'uniform token[] xformOpOrder = ["xformOp:transform"]'
    return field(f"{ONE}matrix4d xformOp:transform = {rows}\n{order}")


@pytest.mark.parametrize(
    ("body", "message"),
    [
        *(
            (moved(axis), r"scene\.usda', /G: the transform")
            for axis in ("2, 0, 0", "1, 0.2, 0", "-1, 0, 0", "0, 0, 0", "nan, 0, 0")
        ),
        (f'def PointInstancer "P" {{\n{ONE}float3[] scales = [(1, 1, 1)]\n}}', "holds no Gaussian"),
        (f'def "G" {{\n{ONE}string[] opacities = ["a"]\n}}', "'opacities' holds StringArray"),
        (field(f"{ONE}float3[] scales = [(-4, -5, -4)]"), "logarithms"),
        (field(f"{ONE}float[] opacities = [-2.5]"), "logits"),
        (field(f"{ONE}float[] opacities = [7]"), "logits"),
        (field(f"{ONE}float3[] scales = [(1, nan, 1)]"), "1 of 1 splats hold NaN"),
        (field(f"{ONE}float[] opacities = [inf]"), "1 of 1 splats hold NaN"),
    ],
)
def test_fields_that_make_no_sense_are_refused(tmp_path: Path, body: str, message: str):
    with pytest.raises(UsdError, match=message):
        read_gaussians(scene(tmp_path, body))


@pytest.mark.parametrize(("suffix", "keep"), [(".usda", 0.5), (".usdc", 0.02), (".usdz", 0.9)])
def test_truncated_files_are_an_error_that_names_them(tmp_path: Path, suffix: str, keep: float):
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, random_gaussians(20))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(keep * len(whole))])
    with pytest.raises(UsdError, match=rf"scene\{suffix}") as caught:
        read_gaussians(path)
    assert "\n" not in str(caught.value)


def test_what_is_no_scene_is_an_error_that_names_it(tmp_path: Path):
    for name in ("notes.txt", "scene.usdz"):
        (tmp_path / name).write_bytes(b"these are not the splats you are looking for" * 10)
        with pytest.raises(UsdError, match=rf"{name}.*not a USD file"):
            read_gaussians(tmp_path / name)
    with pytest.raises(UsdError, match="no such file"):
        read_gaussians(tmp_path / "none.usdz")
    with pytest.raises(UsdError, match="found a folder"):
        read_gaussians(tmp_path)


def test_metadata_of_other_programs_is_not_taken_for_ours(tmp_path: Path):
    header = 'customLayerData = { string digs_warp = "text" }\n    upAxis = "Z"'
    path = scene(tmp_path, field("point3f[] positions = [(0, 0, 0)]"), header)
    assert read_scene(path).metadata == {}
