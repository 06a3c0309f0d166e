"""Where the default sensor tries only two blocks, and whether it finds there what it finds with four."""

from collections.abc import Iterator

import numpy as np

from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.guided.search import search
from digs_warp.sim.sensor.matcher import search_range
from digs_warp.study.realism_scenes import Scene
from digs_warp.study.results import Result

CLOSE = 1 / 16  # [px], one step of the matcher


def region_results(scene: Scene, width: int) -> Iterator[Result]:
    """Yield the share of such pixels in a scene, and the share of them that differ from the search of four.

    A pixel differs if the disparities are apart by more than ``CLOSE``, or only one of them is a hole.
    """
    rig = scene.truth.rig
    left, right = map(gray_of, scene.images())
    found, full = (
        search(left, right, scene.truth.disparity, search_range(rig), rig.window, regions=regions)
        for regions in (True, False)
    )
    apart = ~(np.abs(found.disparity - full.disparity) <= CLOSE)
    differs = apart & ~(np.isnan(found.disparity) & np.isnan(full.disparity))
    narrow = ~found.wide
    yield Result(
        {"width": width, "scene": scene.name, "tuned": scene.tuned},
        {
            "two blocks": float(narrow.mean()),
            "differ there": float(differs[narrow].mean()) if narrow.any() else 0.0,
            "elsewhere": float(differs[~narrow].mean()) if found.wide.any() else 0.0,
        },
        "regions",
    )
