"""The figures of the filters, and docs/sensor.md shows them all."""

import re
from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.color import PIXEL_EFFECTS
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.post_filters.chain import AfterMatching, Shot
from digs_warp.sim.sensor.post_filters.names import FILTERS
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.filter_pictures import SHOWN, filter_figures, flying_pixels

DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_flying_pixels_are_counted_per_pixel_of_outline() -> None:
    true = np.full((20, 40), 10, np.float32)
    true[:, 20:] = 20
    assert flying_pixels(true, true) == 0
    blurred = true.copy()
    blurred[:10, 19] = 15
    assert flying_pixels(blurred, true) == 0.5
    blurred[:, 25] = 15  # wrong, but not at a step
    blurred[10:, 19] = 11  # in the margin of its side
    assert flying_pixels(blurred, true) == 0.5
    assert flying_pixels(np.where(true > 10, np.nan, true), true) == 0


def test_filters_do_what_the_page_says(tmp_path: Path) -> None:
    figures = filter_figures(tmp_path)
    assert {path.stem for path in tmp_path.glob("*.jpg")} == set(SHOWN)
    plain, dense = figures["none"], figures["dense"]
    assert dense.fill > plain.fill + 0.02 and dense.rms < 0.9 * plain.rms
    assert 0.65 < dense.flying < 1.65 and plain.flying < 0.3
    assert figures["spatial"].rms < 0.95 * plain.rms
    assert figures["spatial"].flying == pytest.approx(plain.flying, abs=0.05)
    assert figures["hole-filling"].fill > 0.98


def test_in_holes_the_far_side_is_right_more_often_than_the_near_one() -> None:
    """From six sides; from single ones it may not be."""
    config = SimulateConfig(frames=12, ground="none")
    session = prepare_session(config, load_inputs(config))
    right = {"hole-filling": 0.0, "hole-filling-nearest": 0.0}
    for number in range(0, 12, 2):
        truth, _ = session.truth(number, Shutter())
        images = recorded_images(truth, PIXEL_EFFECTS)
        before = sense(truth, "guided", recorded=images)
        for name in right:
            after = AfterMatching((name,)).apply([Shot(before, gray_of(images[0]))])
            filled = after.known & ~before.known & ~np.isnan(truth.disparity)
            right[name] += (
                float((np.abs(after.disparity - truth.disparity) <= 1)[filled].mean()) / 6
            )
    assert right["hole-filling"] > 1.5 * right["hole-filling-nearest"]


def test_the_page_shows_every_filter() -> None:
    page = (DOCS / "sensor.md").read_text(encoding="utf-8")
    table = page.partition("<!-- filters:")[2].partition("<!-- end -->")[0]
    rows = re.findall(r"^\| (\S+) ", table, re.MULTILINE)
    assert set(FILTERS) <= set(rows)
    assert {path.stem for path in (DOCS / "images/sensor-filters").glob("*.jpg")} == set(SHOWN)
