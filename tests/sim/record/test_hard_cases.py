"""Whole recordings of what usually breaks a depth simulator: odd scenes, odd light, odd meshes."""

import json
import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate

SMALL = SimulateConfig(profile="bare-matcher", frames=1, width=96, height=72, samples_per_pixel=1)


def effects_of(capture: Capture) -> dict[str, bool]:
    """Which effects the plan of a recording has on."""
    plan = json.loads((capture.folder / "sensor_plan.json").read_text())
    return {choice["effect"]: choice["on"] for choice in plan["depth"] + plan["color"]}


def check_frame(capture: Capture) -> None:
    """One frame whose layers agree: no value without a cause, none outside the range."""
    (frame,) = capture.frames
    assert frame.load_image().shape == (72, 96, 3)
    depth, true, cause = frame.load_depth(), frame.load_depth_true(), frame.load_cause()
    assert np.isfinite(true).all() and (true > 0).all()
    assert (cause[~np.isfinite(depth)] != 0).all()
    assert depth[np.isfinite(depth)].min(initial=1.0) > 0


def test_in_an_all_black_environment_nothing_is_seen_and_nothing_measured(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(
        logging.WARNING, "digs_warp"
    )  # a command of another test may have left it quiet
    write_image(tmp_path / "night.png", np.zeros((8, 16, 3), np.uint8))
    config = replace(SMALL, environment=tmp_path / "night.png")
    capture = simulate(replace(config, effects="none"), tmp_path / "dark")
    assert "every pixel is black" in caplog.text
    (frame,) = capture.frames
    assert not frame.load_image().any()
    assert not np.isfinite(frame.load_depth()).any() or not frame.load_confidence().any()


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        ("boot_plain", set()),  # no texture at all
        ("sword_plain", set()),  # metal a few pixels wide
        ("water_bottle_clear", {"transparency"}),
        ("flight_helmet", {"transparency"}),  # six materials, a visor among them
    ],
)
@pytest.mark.long
def test_meshes_with_what_stereo_cannot_match_switch_on_their_effects(
    sample_data: Path, tmp_path: Path, mesh: str, expected: set[str]
) -> None:
    path = sample_data / "meshes" / mesh / f"{mesh}.glb"
    capture = simulate(replace(SMALL, mesh=path, frames=1), tmp_path / mesh)
    check_frame(capture)
    effects = effects_of(capture)
    assert expected <= {name for name, on in effects.items() if on}
