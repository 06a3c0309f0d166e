"""Pictures of the report: color scales, small images, causes, the chart, and Gaussians packed for it."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.sh import C0
from digs_warp.show.report.causes import OK_COLOR, PATTERNS, TILE, paint_causes
from digs_warp.show.report.course_section import line_chart
from digs_warp.show.report.pictures import ColorScale, depth_scale, error_scale, over_white, shrink
from digs_warp.show.report.view3d.pack import pack
from reference.unpacked_splats import unpacked
from reference.usd_files import covariances


def test_missing_values_are_gray_and_the_ends_of_a_scale_saturate() -> None:
    scale = ColorScale("x", 1.0, 2.0, "viridis")
    colors = scale.paint(np.array([[np.nan, 0.0, 1.0, 2.0, 99.0]]))[0]
    assert colors[0].tolist() == [128, 128, 128]
    assert colors[1].tolist() == colors[2].tolist() == [68, 1, 84]  # viridis begins in dark violet
    assert colors[3].tolist() == colors[4].tolist() == [253, 231, 37]  # and ends in yellow
    assert scale.gradient(2) == ["rgb(68 1 84)", "rgb(253 231 37)"]


@pytest.mark.parametrize(
    "values", [np.zeros(0), np.full(5, np.nan), np.full(5, 1.25), np.array([0.5, 1.0, np.nan])]
)
def test_scales_of_any_values_have_a_range(values: np.ndarray) -> None:
    depths, errors = depth_scale(values), error_scale(values)
    assert 0 <= depths.low < depths.high
    assert errors.low == -errors.high < 0


def test_shrinking_keeps_the_mean_and_small_images() -> None:
    image = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    small = shrink(image, 20)
    assert small.shape == (13, 20, 3)
    np.testing.assert_allclose(small.mean(), image[:39, :60].mean(), atol=0.5)
    assert shrink(image, 60) is image
    assert shrink(image[:1], 20).shape == (1, 60, 3)


def test_the_object_stands_on_white() -> None:
    image = np.full((1, 3, 3), 100, dtype=np.uint8)
    found = over_white(image, np.array([[0, 255, 128]], dtype=np.uint8))
    assert found[0, :, 0].tolist() == [255, 100, round(100 * 128 / 255 + 127)]
    assert over_white(image, None) is image


def darker_places(code: int, step: int = 1) -> np.ndarray:
    """Where the picture of one cause is darker than its brightest place."""
    picture = shrink(paint_causes(np.full((4 * TILE * step,) * 2, code, np.uint8), step), 4 * TILE)
    gray = picture.astype(int).sum(axis=2)
    return gray < gray.max()


def test_causes_differ_in_their_patterns_and_right_depth_has_none() -> None:
    codes = range(1, len(PATTERNS) + 1)
    patterns = [darker_places(code) for code in codes]
    for number, one in enumerate(patterns):
        for other in patterns[:number]:
            assert (one != other).mean() > 0.1
    np.testing.assert_array_equal(patterns, [darker_places(code, step=3) for code in codes])
    assert (paint_causes(np.zeros((5, 7), np.uint8)) == OK_COLOR).all()


@pytest.mark.parametrize(
    ("points", "texts", "ends"),
    [
        ([(0, 17.5), (300, 26)], {"0", "50", "300", "16", "26"}, [(62, 243.2), (504, 12)]),
        (
            [(100, -0.02), (900, 0.13)],
            {"0", "1,000", "-0.05", "0.15"},
            [(106.2, 243.2), (459.8, 39.2)],
        ),
    ],
)
def test_all_of_a_chart_lies_within_it(points, texts, ends) -> None:
    root = ElementTree.fromstring(line_chart(np.array(points)))
    width, height = (float(number) for number in root.attrib["viewBox"].split()[2:])
    for element in root:
        for key, most in (("x", width), ("y", height)):
            assert 0 <= float(element.get(key, 0)) <= most
    assert texts | {"iterations", "PSNR [dB]"} <= {each.text for each in root.iter() if each.text}
    line = re.findall(r"(-?[\d.]+) (-?[\d.]+)", root[1].attrib["d"])
    np.testing.assert_allclose(np.array(line, float), ends, atol=0.5)


def some_gaussians(count: int = 3000) -> Gaussians:
    rng = np.random.default_rng(3)
    return Gaussians(
        rng.normal(size=(count, 3)) * [1.0, 5.0, 100.0],
        rng.uniform(-9.0, -2.0, (count, 3)),
        rng.normal(size=(count, 4)) * 3.0,
        rng.normal(size=count) * 2.0,
        rng.normal(size=(count, 4, 3)) * 0.4,
    )


def test_what_is_unpacked_is_what_was_packed() -> None:
    g = some_gaussians()
    g.quats[:4] = np.eye(4) * [[-2.0], [1.0], [-1.0], [5.0]]
    packed = pack(g)
    found = unpacked(packed)
    assert len(packed) == packed.total == len(g)
    extent = g.means.max(axis=0) - g.means.min(axis=0)
    assert (np.abs(found.centers - g.means) < extent / 2**24 + 1e-5).all()
    true = covariances(g.quats, g.scales)
    size = np.trace(true, axis1=1, axis2=2)[:, None, None]
    assert np.abs((found.covariances - true) / size).max() < 0.04  # steps of 2.7 % in a length
    rgb = np.clip(0.5 + C0 * g.sh[:, 0], 0, 1)
    np.testing.assert_allclose(found.colors, rgb, atol=0.5 / 255 + 1e-6)
    np.testing.assert_allclose(found.opacities, g.opacities, atol=0.5 / 255 + 1e-6)


def test_the_highest_harmonics_go_before_any_gaussian_then_those_that_cover_the_least() -> None:
    g = some_gaussians()
    whole = pack(g)
    assert len(whole.to_bytes()) == len(g) * (20 + 9)
    wrong = np.abs(unpacked(whole).harmonics - g.sh[:, 1:])
    assert np.quantile(wrong, 0.998) < 0.51 * whole.harmonic_step and wrong.max() < 1.0
    assert whole.harmonic_step < 0.02
    less = pack(g, most_bytes=len(g) * 25 * 4 // 3)
    assert (len(less), less.harmonics.shape[1]) == (len(g), 0)
    least = pack(g, most_bytes=1000 * 20 * 4 // 3)
    assert (len(least), least.total, least.harmonics.shape) == (999, 3000, (999, 0, 3))
    area = g.opacities * np.exp(np.sort(g.log_scales, axis=1)[:, 1:].sum(axis=1))
    kept = np.sort(np.argsort(-area)[:999])
    np.testing.assert_allclose(unpacked(least).centers, g.means[kept], atol=1e-4)


def test_flat_boxes_zero_quaternions_and_broken_values_are_fine() -> None:
    g = some_gaussians(50)
    g.means[:] = 1.5
    g.log_scales[:] = -4.0
    g.quats[:] = 0.0
    g.means[7, 1] = np.nan
    g.sh[9] = np.inf
    found = unpacked(pack(g))
    assert len(found.centers) == 48
    np.testing.assert_allclose(found.centers, 1.5, atol=1e-6)
    round_ones = np.exp(-8.0) * np.eye(3)
    np.testing.assert_allclose(
        found.covariances, np.tile(round_ones, (48, 1, 1)), rtol=5e-3, atol=3e-6
    )
