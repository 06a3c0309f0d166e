"""An object or the whole scene: what decides, and what a run keeps of it."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.init.config import InitConfig
from digs_warp.masks.config import SegmentConfig
from digs_warp.pipeline.config import FrontEndConfig, SubjectChoice, subject_of
from digs_warp.pipeline.front_end import FrontEnd, front_end, load_front_end
from digs_warp.record.run_log import RunLog, RunRecord
from reference.ball_capture import WALL_RADIUS, ball_views, write_capture

CONFIG = FrontEndConfig(init=InitConfig(edge_filter=False), test_every=4)


@pytest.fixture(scope="module")
def masked(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_capture(tmp_path_factory.mktemp("ball"), ball_views())


@pytest.fixture(scope="module")
def unmasked(masked: Capture) -> Capture:
    return replace(masked, frames=tuple(f.without_layer(Layer.MASK) for f in masked.frames))


def prepared(capture: Capture, folder: Path, choice: SubjectChoice = "auto") -> FrontEnd:
    config = replace(CONFIG, subject=choice)
    return front_end(capture, config, folder, RunLog("test", config))


def farthest(result: FrontEnd) -> float:
    return float(np.linalg.norm(result.start.points.points_world, axis=1).max())


def test_masks_decide(masked: Capture, unmasked: Capture) -> None:
    from_depth = SegmentConfig(masks="depth")
    assert subject_of(masked, "auto", SegmentConfig()) == "object"
    assert subject_of(unmasked, "auto", SegmentConfig()) == "scene"
    assert subject_of(unmasked, "auto", from_depth) == "object"
    assert subject_of(masked, "scene", SegmentConfig()) == "scene"
    assert subject_of(unmasked, "object", SegmentConfig()) == "object"
    with pytest.raises(
        DigsError, match="--subject scene: no masks are used; leave out --masks depth"
    ):
        subject_of(unmasked, "scene", from_depth)


def test_without_masks_everything_in_view_is_reconstructed_and_the_log_says_so(
    unmasked: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO):
        result = prepared(unmasked, tmp_path)
    assert result.poses.subject == "scene"
    assert farthest(result) > 0.9 * WALL_RADIUS
    assert "no masks, so everything in view is reconstructed (--subject scene)" in caplog.text
    assert "add --masks depth" in caplog.text


def test_a_scene_leaves_the_masks_of_the_recording_alone(masked: Capture, tmp_path: Path) -> None:
    result = prepared(masked, tmp_path, "scene")
    assert farthest(result) > 0.9 * WALL_RADIUS
    every = (*result.poses.posed.training, *result.poses.posed.held_out)
    assert not any(frame.has(Layer.MASK) for frame in every)
    record = RunRecord.find(tmp_path)
    assert record is not None and record.results["poses"]["subject"] == "scene"
    # What is read again, for a report or to continue, has no masks either.
    again = load_front_end(masked, tmp_path)
    assert again.poses.subject == "scene"
    assert not any(frame.has(Layer.MASK) for frame in again.poses.posed.training)
