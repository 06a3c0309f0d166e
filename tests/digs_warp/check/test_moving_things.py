"""A scene that changed halfway is noticed, and one that did not is not."""

from dataclasses import replace
from pathlib import Path

import pytest

from digs_warp.check.check import check_capture
from digs_warp.check.evidence import Evidence
from digs_warp.check.findings import limit_of
from digs_warp.check.motion import FRAMES, moment_of_change, scene_change
from digs_warp.check.thresholds import CHANGE_FACTOR
from digs_warp.data.capture import Capture
from digs_warp.measure.thumbnails import small_frames
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from reference.real_captures import recorded
from reference.wrong_captures import two_in_one

MARGIN = 1.5
CHANGED = limit_of("change")


def walk(distractors: int) -> Capture:
    """The same walk, with or without things beside the object."""
    return simulate_in_memory(
        SimulateConfig(
            frames=FRAMES, width=160, height=90, samples_per_pixel=1, distractors=distractors
        )
    )


@pytest.fixture(scope="module")
def empty() -> Capture:
    return walk(0)


@pytest.fixture(scope="module")
def furnished() -> Capture:
    return walk(6)


def shares(capture: Capture) -> tuple[float, float]:
    frames = small_frames(capture.frames, range(len(capture)))
    moment = moment_of_change([*frames.values()])
    assert moment is not None
    return moment.across, moment.within


def test_things_that_were_put_there_halfway_are_noticed(empty: Capture, furnished: Capture) -> None:
    joined = two_in_one(empty, furnished)
    (found,) = check_capture(joined).findings
    assert found.kind == "change" and not found.is_error
    first, then = (int(words.split(" ")[0]) for words in found.what.split("frame ")[1:3])
    assert then == first + 1 and abs(then - FRAMES // 2) <= 1
    across, within = shares(joined)
    assert across > MARGIN * CHANGE_FACTOR * within


def test_a_scene_that_stays_is_not(empty: Capture, furnished: Capture) -> None:
    for capture in (empty, furnished):
        assert scene_change(Evidence(capture), CHANGED) is None
        assert MARGIN * shares(capture)[0] < CHANGED


@pytest.mark.parametrize("kind", ["hololens_room_sequence", "tum_cabinet_orbit"])
def test_nor_is_a_real_one(sample_data: Path, kind: str) -> None:
    capture = recorded(sample_data / "rgbd" / kind, kind)
    assert scene_change(Evidence(capture), CHANGED) is None
    assert MARGIN * shares(replace(capture, frames=capture.frames[:FRAMES]))[0] < CHANGED
