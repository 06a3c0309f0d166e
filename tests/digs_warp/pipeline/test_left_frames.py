"""Frames that cannot be placed may be all that were held out: others then measure the result."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.init.config import InitConfig
from digs_warp.masks.config import SegmentConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.refine_poses import with_held_out
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.train.config import Stop, TrainConfig
from reference.trained_ball import assert_same_bits, interrupt

FRAMES = 12
# So one frame is held out; without it, the one before it is the middle of the others.
EVERY = FRAMES
MIDDLE = FRAMES // 2


@pytest.fixture(scope="module")
def mirrored(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Half a turn around the built-in object; no camera sees what the middle frame shows."""
    settings = {"width": 320, "tier": "law", "camera_path": "arc", "seed": 3}
    folder = tmp_path_factory.mktemp("mirrored") / "capture"
    frames = dw.simulate(
        profile="bare-matcher", frames=FRAMES, elevations=(20.0,), out=folder, **settings
    ).frames
    odd = frames[MIDDLE]
    for layer, values in ((Layer.IMAGE, odd.load_image()), (Layer.DEPTH, odd.load_depth())):
        write_image(odd.path(layer), np.ascontiguousarray(values[:, ::-1]))
    return read_capture(folder)


def names_of(frames: Sequence[Frame]) -> list[str]:
    return [frame.name for frame in frames]


def test_another_frame_measures_the_result_also_after_a_resumed_run(
    mirrored: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = ReconstructConfig(
        sfm=SfmConfig(poses="capture", refine_poses="on"),
        segment=SegmentConfig(masks="depth"),
        test_every=EVERY,
        init=InitConfig(voxel_size=0.02),
        train=TrainConfig(stop=Stop(iterations=6), sh_degree=0),
    )
    whole = reconstruct(mirrored, config, tmp_path / "whole")
    names = names_of(mirrored.frames)
    assert whole.frames is not None and whole.poses.refinement is not None
    assert f"left out: {names[MIDDLE]}" in whole.poses.refinement.because
    assert names_of(whole.frames.held_out) == [names[MIDDLE - 1]]
    assert names_of(whole.frames.training) == names[: MIDDLE - 1] + names[MIDDLE + 1 :]
    assert [view.name for view in whole.scores.views] == [names[MIDDLE - 1]]
    # The evaluation uses the mask of the recording, the training ours.
    masks = [
        frame.path(Layer.MASK) for frame in (*whole.frames.held_out, mirrored.frames[MIDDLE - 1])
    ]
    assert masks[0] == masks[1]
    assert whole.frames.training[0].path(Layer.MASK).is_relative_to(tmp_path)

    interrupt(lambda: reconstruct(mirrored, config, tmp_path / "resumed"), 3, monkeypatch)
    resumed = reconstruct(mirrored, config, tmp_path / "resumed", resume=True)
    assert resumed.frames is not None
    assert names_of(resumed.frames.held_out) == [names[MIDDLE - 1]]
    assert resumed.scores == whole.scores
    assert_same_bits(resumed.gaussians, whole.gaussians)


def left_of(capture: Capture, test_every: int, lost: Sequence[int]) -> PosedFrames:
    names = {capture.frames[number].name for number in lost}
    whole = PosedFrames.split(capture, test_every)
    training, held_out = (
        tuple(frame for frame in group if frame.name not in names)
        for group in (whole.training, whole.held_out)
    )
    return replace(whole, training=training, held_out=held_out)


def test_what_holds_out_nothing_stays_without(mirrored: Capture) -> None:
    nothing = replace(mirrored, held_out=frozenset())
    left = left_of(nothing, 8, [3])
    assert with_held_out(left, nothing, 8) is left


def test_the_last_frame_is_for_the_training(mirrored: Capture) -> None:
    left = left_of(mirrored, EVERY, range(1, FRAMES))
    assert with_held_out(left, mirrored, EVERY) is left


def test_where_all_others_are_left_out_some_train(mirrored: Capture) -> None:
    left = left_of(mirrored, 2, [0, 2, 4, 6, 8, 10])
    assert not left.training
    found = with_held_out(left, mirrored, 2)
    names = names_of(mirrored.frames)
    assert names_of(found.held_out) == names[3:12:4]
    assert names_of(found.training) == names[1:12:4]
