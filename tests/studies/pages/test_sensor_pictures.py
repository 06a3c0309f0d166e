"""The still life provokes every effect, and docs/sensor.md shows them all."""

import re
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.images import read_image
from digs_warp.sim.sensor.color import COLOR_EFFECTS
from digs_warp.sim.sensor.effects import AFTER_MATCHING, EFFECTS
from studies.pages.sensor_pictures import TIERS_PICTURE, SensorStudio, depth_strip

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.fixture(scope="module")
def studio() -> SensorStudio:
    return SensorStudio()


@pytest.mark.parametrize("effect", AFTER_MATCHING, ids=lambda effect: effect.name)
def test_every_effect_shows_on_the_still_life(studio: SensorStudio, effect) -> None:
    figure = studio.depth_figure(effect)
    assert figure.changed.sum() >= 100
    # Beside holes there are errors, and nothing else is touched.
    untouched = figure.sensed.disparity[~figure.changed]
    np.testing.assert_array_equal(untouched, figure.truth.disparity[~figure.changed])


def test_the_planner_sees_what_the_still_life_is_made_for(studio: SensorStudio) -> None:
    off = {e.name for e in EFFECTS if not e.choose(studio.facts, studio.rig).on}
    assert off == set()


def test_a_strip_is_drawn(studio: SensorStudio, tmp_path: Path) -> None:
    depth_strip(studio.depth_figure(AFTER_MATCHING[0]), tmp_path / "strip.jpg")
    pixels = read_image(tmp_path / "strip.jpg")
    _, width, channels = pixels.shape
    assert channels == 3
    panels = [pixels[30:-5, i * width // 4 + 8 : (i + 1) * width // 4 - 8] for i in range(4)]
    assert len({panel.tobytes() for panel in panels}) == 4


def test_the_page_shows_every_effect() -> None:
    """`make sensor` has been run since an effect was added, renamed or removed."""
    page = (DOCS / "sensor.md").read_text(encoding="utf-8")
    names = [effect.name for effect in (*EFFECTS, *COLOR_EFFECTS)]
    assert re.findall(r"^### (\S+)$", page, re.MULTILINE) == names
    pictures = {path.stem for path in (DOCS / "images/sensor").glob("*.jpg")}
    assert pictures == {TIERS_PICTURE, *names}
