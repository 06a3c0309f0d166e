"""Outlier frames, two recordings in one, poses that jump, and frames that repeat are named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.check.check import check_capture
from digs_warp.check.evidence import Evidence
from digs_warp.check.findings import CHECKS, Finding, limit_of
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.poses.photo_matches import agreeing_shares
from digs_warp.poses.thresholds import USUAL_MATCH_SHARE
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from reference.real_captures import recorded
from reference.wrong_captures import each_frame, with_a_jump

FRAMES, WIDTH = 16, 160
STEPS = 12  # frames of the photographs without depth
MARGIN = 1.3
OUTLIERS = "outlier frames", "break"


def look_for(capture: Capture, *kinds: str) -> list[Finding]:
    """What the checks of some kinds find."""
    evidence = Evidence(capture)
    found = (check.look(evidence) for check in CHECKS if check.kind in kinds)
    return [each for each in found if each is not None]


def unposed(capture: Capture) -> Capture:
    return replace(capture, about=replace(capture.about, poses_known=False))


@pytest.fixture(scope="module")
def good() -> Capture:
    return simulate_in_memory(
        SimulateConfig(
            profile="bare-matcher", frames=FRAMES, width=WIDTH, height=90, samples_per_pixel=1
        )
    )


def test_a_good_capture_has_neither(good: Capture) -> None:
    assert look_for(good, *OUTLIERS, "repeats") == []


@pytest.mark.parametrize("number", [0, 1, 7, FRAMES - 1])
def test_a_frame_with_a_broken_pose_is_named(good: Capture, number: int) -> None:
    (found,) = look_for(with_a_jump(good, (0.0, 0.0, 0.1), 40.0, [number]), *OUTLIERS)
    assert found.kind == "outlier frames" and not found.is_error
    assert found.what.endswith(f"after: {good.frames[number].name}.")


def test_two_recordings_in_one_break_between_them(good: Capture) -> None:
    two = with_a_jump(good, (0.0, 0.0, 0.1), 40.0)
    assert look_for(unposed(two), *OUTLIERS) == []
    (found,) = look_for(two, *OUTLIERS)
    assert found.kind == "break" and found.is_error
    assert f"between frames {good.frames[7].name} and {good.frames[8].name}." in found.what


def test_a_camera_that_comes_back_does_not_break(good: Capture) -> None:
    """Looking away at once, and back at what was seen before."""
    half = FRAMES // 2
    order = [*range(0, FRAMES, half), *range(1, FRAMES, half), *range(2, FRAMES, half)]
    there_and_back = replace(good, frames=tuple(good.frames[i] for i in order))
    assert look_for(there_and_back, *OUTLIERS) == []


def spoilt(mask: np.ndarray, how: str) -> np.ndarray:
    """The mask as a segmentation may fail: nothing, half of the object, or something beside it, too."""
    mask = mask.copy()
    rows, columns = np.nonzero(mask > 127)
    if how == "empty":
        mask[:] = 0
    elif how == "cut":
        mask[:, : int(np.median(columns))] = 0
    else:
        top, right = int(np.median(rows)), columns.max() - 2
        mask[top : rows.max() + 1, right : right + np.ptp(columns)] = 255
    return mask


@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_a_camera_at_rest_and_doubled_frames_are_told(good: Capture, noise: float) -> None:
    rng = np.random.default_rng(0)

    def again(number: int) -> Frame:
        frame = good.frames[number]
        image = frame.load_image() + rng.normal(0, noise, (90, WIDTH, 3))
        return frame.with_layer(Layer.IMAGE, np.clip(image, 0, 255).astype(np.uint8))

    (rest,) = look_for(replace(good, frames=tuple(again(4) for _ in range(6))), "repeats")
    assert "5 frames of 6 repeat the one before" in rest.what
    (doubled,) = look_for(replace(good, frames=tuple(again(i // 2) for i in range(12))), "repeats")
    assert "6 frames of 12 repeat the one before" in doubled.what
    one_pause = (*good.frames[:8], again(7), *good.frames[8:])
    assert look_for(replace(good, frames=one_pause), "repeats") == []


@pytest.fixture(scope="module")
def arc() -> Capture:
    """An arc around the built-in object in its room."""
    walk = WalkSettings(path="arc", elevations=(30.0,))
    config = SimulateConfig(
        profile="bare-matcher", frames=STEPS, width=320, height=180, samples_per_pixel=1, walk=walk
    )
    return simulate_in_memory(config)


def test_masks_that_those_around_contradict_are_named(good: Capture, arc: Capture) -> None:
    odd = {2: "empty", 5: "cut", 8: "neighbor"}

    def with_wrong_mask(frame: Frame) -> Frame:
        how = odd.get(int(frame.name))
        return frame.with_layer(Layer.MASK, spoilt(frame.load_mask(), how)) if how else frame

    assert look_for(good, "masks disagree") == look_for(arc, "masks disagree") == []
    (found,) = look_for(each_frame(arc, with_wrong_mask), "masks disagree", *OUTLIERS)
    assert found.kind == "masks disagree" and not found.is_error
    assert "3 masks of 12" in found.what
    assert all(arc.frames[number].name in found.what for number in odd)


@pytest.fixture(scope="module")
def photographs(arc: Capture) -> Capture:
    """The same without depth and masks."""
    return bare(arc)


def bare(capture: Capture) -> Capture:
    return each_frame(capture, lambda f: f.without_layer(Layer.DEPTH).without_layer(Layer.MASK))


@pytest.mark.parametrize(("shift", "turn"), [((0.0, 0.0, 0.1), 0.0), ((0.5, -0.2, 0.0), 40.0)])
def test_a_jump_is_named(
    photographs: Capture, shift: tuple[float, float, float], turn: float
) -> None:
    jumping = with_a_jump(photographs, shift, turn)
    (found,) = check_capture(jumping).findings
    assert found.kind == "pose jump" and not found.is_error
    before, after = (photographs.frames[STEPS // 2 + i].name for i in (-1, 0))
    assert f"between frames {before} and {after}:" in found.what
    # Depth tells more, and poses that are unknown tell nothing.
    depth = np.ones((180, 320), np.float32)
    deep = each_frame(jumping, lambda frame: frame.with_layer(Layer.DEPTH, depth))
    assert look_for(deep, "pose jump") == look_for(unposed(jumping), "pose jump") == []


def test_right_poses_have_none(photographs: Capture) -> None:
    assert check_capture(photographs).findings == ()
    shares = [share for share in agreeing_shares(photographs.frames) if share is not None]
    assert len(shares) > STEPS / 2
    assert min(shares) > MARGIN * limit_of("pose jump")
    assert np.median(shares) > MARGIN * USUAL_MATCH_SHARE


def test_exposure_of_photographs_is_told_by_what_they_match(photographs: Capture) -> None:
    """Half a stop from frame to frame, with poses or without."""

    def other_exposure(frame: Frame) -> Frame:
        light = 0.5 * (frame.load_image() / 255.0) ** 2.2 * 2 ** (0.5 * (int(frame.name) % 2))
        return frame.with_layer(Layer.IMAGE, (255 * light ** (1 / 2.2)).astype(np.uint8))

    uneven = each_frame(photographs, other_exposure)
    for capture in (uneven, unposed(uneven)):
        (found,) = look_for(capture, "exposure")
        assert "changes by 0.5 stops" in found.what
    assert look_for(photographs, "exposure") == []


def test_a_real_room_without_its_depth_has_none_until_it_jumps(sample_data: Path) -> None:
    room = bare(recorded(sample_data / "rgbd" / "hololens_room_sequence", "hololens_room_sequence"))
    assert check_capture(room).findings == ()
    (found,) = look_for(with_a_jump(room, (0.3, 0.0, 0.2), 20.0), "pose jump")
    assert found.kind == "pose jump"
