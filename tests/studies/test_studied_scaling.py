"""The benchmarks of the rasterizer: counts against brute force, the fit against a known law."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer
from studies.growth import MEMORY, results
from studies.raster import NEAR, count_work
from studies.results import Result
from studies.scaling import BASE, Case, fit_laws, measure, scaling_charts

SMALL = replace(BASE, width=64, height=48, splats=40)


def test_the_work_is_that_of_a_count_by_hand() -> None:
    renderer = SplatRenderer(DeviceGaussians.from_numpy(SMALL.gaussians()), 64, 48)
    renderer.forward(SMALL.camera(), near=NEAR)
    lists = renderer.binner.lists
    starts, members, splats = (
        array.numpy() for array in (lists.tile_starts, lists.tile_splats, lists.splats)
    )
    rows = pixels = 0
    for tile in range(4 * 3):
        for g in members[starts[tile] : starts[tile + 1]]:
            u, v, half_width, half_height = splats[g, [0, 1, 9, 10]]
            x = 16 * (tile % 4) + np.arange(16) + 0.5
            y = 16 * (tile // 4) + np.arange(16) + 0.5
            drawn_rows = np.flatnonzero(np.abs(y - v) <= half_height)
            columns = np.flatnonzero(np.abs(x - u) <= half_width)
            rows += len(drawn_rows)
            pixels += 16 * len(np.unique(drawn_rows // 2)) * len(np.unique(columns // 8))
    work = count_work(renderer)
    assert work.rows == rows > 100
    assert work.pixels == pixels


def test_the_fit_finds_a_law() -> None:
    rng = np.random.default_rng(0)
    points = []
    for _ in range(9):
        pixels, splats, pairs, evaluated = (int(v) for v in rng.uniform(1e3, 1e6, 4))
        raster = 1e-6 * (3.0 * pixels + 50.0 * pairs + 0.5 * evaluated)
        per_splat = 1e-6 * (200.0 * splats + 30.0 * pairs)
        labels = {"pixels": pixels, "splats": splats, "pairs": pairs, "evaluated": evaluated}
        points.append(Result(labels, {"raster [ms]": raster, "per splat [ms]": per_splat}))
    raster, per_splat = (r.values for r in fit_laws(points))
    assert raster["per pixels [ns]"] == pytest.approx(3.0)
    assert raster["per pairs [ns]"] == pytest.approx(50.0)
    assert raster["per evaluated [ns]"] == pytest.approx(0.5)
    assert per_splat["per splats [ns]"] == pytest.approx(200.0)
    assert per_splat["per pairs [ns]"] == pytest.approx(30.0)
    assert raster["largest [%]"] == pytest.approx(0.0, abs=1e-6)


def test_a_case_is_measured_and_drawn() -> None:
    points = [measure(Case("splats", n, replace(SMALL, splats=n)), repeats=1) for n in (10, 40)]
    assert all(p.values["raster [ms]"] > 0 and p.values["per splat [ms]"] > 0 for p in points)
    assert all(p.labels["evaluated"] > p.labels["pairs"] for p in points)
    assert len(scaling_charts([*points, *fit_laws(points)])) == 1


def test_growth_is_the_exponent_between_the_two_largest_sizes() -> None:
    costs = [{"fit": 9.0}, {"fit": 0.5, "rest": 0.0}, {"fit": 8.0, "rest": 0.0, MEMORY: 700.0}]
    fit, rest, memory = results("t", ["1", "10", "40"], [1, 10, 40], costs)
    assert fit.labels == {"stage": "fit [CPU s]"} and memory.labels == {"stage": MEMORY}
    assert fit.values == {"1": 9.0, "10": 0.5, "40": 8.0, "exponent": 2.0}
    assert rest.values["exponent"] == 0.0
