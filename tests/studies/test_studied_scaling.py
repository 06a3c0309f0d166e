"""The benchmarks of the rasterizer: counts against brute force, the exponent of growth."""

import numpy as np

from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer
from studies.growth import MEMORY, results
from studies.raster import NEAR, RasterScene, count_work

SMALL = RasterScene("small", 64, 48, 40, lambda rng, n: rng.uniform(1.0, 4.0, (n, 2)))


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


def test_growth_is_the_exponent_between_the_two_largest_sizes() -> None:
    costs = [{"fit": 9.0}, {"fit": 0.5, "rest": 0.0}, {"fit": 8.0, "rest": 0.0, MEMORY: 700.0}]
    fit, rest, memory = results("t", ["1", "10", "40"], [1, 10, 40], costs)
    assert fit.labels == {"stage": "fit [CPU s]"} and memory.labels == {"stage": MEMORY}
    assert fit.values == {"1": 9.0, "10": 0.5, "40": 8.0, "exponent": 2.0}
    assert rest.values["exponent"] == 0.0
