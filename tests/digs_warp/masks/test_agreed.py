"""Masks that most other views contradict are found and mended; good ones stay as they are."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.check.check import check_capture
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.masks.agreed import agreed_masks
from digs_warp.masks.config import SegmentConfig
from digs_warp.pipeline.config import FrontEndConfig
from digs_warp.pipeline.front_end import front_end, load_front_end
from digs_warp.record.run_log import RunLog
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from reference.overlap import intersection_over_union

WRONG = {2: "empty", 5: "cut", 7: "neighbor", 11: "empty"}


@pytest.fixture(scope="module")
def good() -> Capture:
    config = SimulateConfig(
        profile="bare-matcher", frames=16, width=160, height=90, samples_per_pixel=2
    )
    return simulate_in_memory(config)


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


def with_wrong_masks(capture: Capture) -> list[Frame]:
    return [
        frame.with_layer(Layer.MASK, spoilt(frame.load_mask(), WRONG[n])) if n in WRONG else frame
        for n, frame in enumerate(capture.frames)
    ]


def test_good_masks_stay(good: Capture, tmp_path: Path) -> None:
    frames, sentence = agreed_masks(good.frames, tmp_path / "mended")
    assert frames == list(good.frames) and sentence is None
    assert not (tmp_path / "mended").exists()


def test_wrong_masks_are_mended_and_named(good: Capture, tmp_path: Path) -> None:
    wrong = with_wrong_masks(good)
    frames, sentence = agreed_masks(wrong, tmp_path)
    assert sentence is not None and sentence.startswith("4 masks of 16 contradicted")
    for number, (mended, frame) in enumerate(zip(frames, good.frames, strict=True)):
        overlap = intersection_over_union(mended.load_mask(), frame.load_mask())
        assert overlap > 0.8 if number in WRONG else mended is wrong[number]
        assert (frame.name in sentence) == (number in WRONG)


def test_the_check_names_the_frames(good: Capture) -> None:
    (finding,) = check_capture(Capture(None, tuple(with_wrong_masks(good)), None)).findings
    assert finding.kind == "masks disagree" and not finding.is_error
    assert all(good.frames[number].name in finding.what for number in WRONG)


def test_most_masks_wrong_change_nothing(good: Capture, tmp_path: Path) -> None:
    empty = np.zeros((90, 160), np.uint8)
    wrong = [
        frame.with_layer(Layer.MASK, empty) if number % 4 else frame
        for number, frame in enumerate(good.frames)
    ]
    assert agreed_masks(wrong, tmp_path) == (wrong, None)


@pytest.mark.parametrize("agreement", ["on", "off"])
def test_the_reconstruction_starts_from_mended_masks(
    good: Capture, tmp_path: Path, agreement: str
) -> None:
    segment = SegmentConfig(mask_agreement=agreement)  # pyright: ignore[reportArgumentType]
    wrong = Capture(None, tuple(with_wrong_masks(good)), good.rig, good.about)
    config = FrontEndConfig(segment=segment)
    log = RunLog("test", config)
    prepared = front_end(wrong, config, tmp_path, log)
    masks = {frame.name: frame.load_mask() for frame in prepared.poses.posed.training}
    assert (masks[good.frames[2].name].max() > 0) == (agreement == "on")
    named = [
        finding for finding in prepared.poses.findings if "contradicted most other views" in finding
    ]
    assert len(named) == (agreement == "on")
    log.save(tmp_path / "run.json")
    again = load_front_end(wrong, tmp_path)
    for frame in again.poses.posed.training:
        np.testing.assert_array_equal(frame.load_mask(), masks[frame.name])
