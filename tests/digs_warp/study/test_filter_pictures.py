"""The figures of the filters, and docs/sensor.md shows them all."""

import re
from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.sensor.after.names import FILTERS
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
    # In holes beside near things, what is far is right more often than what is near.
    assert figures["hole-filling"].filled_right > 1.5 * figures["hole-filling-nearest"].filled_right


def test_the_page_shows_every_filter() -> None:
    page = (DOCS / "sensor.md").read_text(encoding="utf-8")
    table = page.partition("<!-- filters:")[2].partition("<!-- end -->")[0]
    rows = re.findall(r"^\| (\S+) ", table, re.MULTILINE)
    assert set(FILTERS) <= set(rows)
    assert {path.stem for path in (DOCS / "images/sensor-filters").glob("*.jpg")} == set(SHOWN)
