"""The measured depth in the training, and where it is wrong."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import FIELDS
from digs_warp.data.layers import Layer
from digs_warp.splat.render import render
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.trainer import Trainer
from reference.tiny_capture import ball, drawn_depth
from reference.trained_ball import trained

FRAMES, SHORT = 6, Stop(iterations=40)


def off_by(trainer: Trainer, frames: Sequence[Frame]) -> float:
    """The median distance [m] between the expected depth of the skins and that of the frames."""
    gaussians, options = trainer.gaussians.to_numpy(), trainer.renderer.middle.options
    options = replace(options, outputs="depth")
    distances = []
    for frame in frames:
        drawn = render(gaussians, frame.camera, options=options).depth
        assert drawn is not None
        distances.append(np.abs(drawn - frame.load_depth())[frame.load_mask() >= 128])
    return float(np.nanmedian(np.concatenate(distances)))


def test_a_strong_weight_holds_the_surface(capture: Capture) -> None:
    """At a depth that differs from that of the photographs by less than their errors."""
    frames = [f.with_layer(Layer.DEPTH, drawn_depth(f) + 0.002) for f in capture.frames]
    loose, held = (
        off_by(trained(frames, TrainConfig(stop=SHORT, depth_weight=weight), ball()), frames)
        for weight in (0.0, 0.3)
    )
    assert held < 0.85 * loose


def test_some_or_all_frames_may_lack_depth(capture: Capture) -> None:
    bare = [frame.without_layer(Layer.DEPTH) for frame in capture.frames]
    without = trained(bare, TrainConfig(stop=SHORT))
    off = trained(capture.frames, TrainConfig(stop=SHORT, depth_weight=0.0))
    assert np.array_equal(without.gaussians.means.numpy(), off.gaussians.means.numpy())
    assert not without.renderer.middle.options.has_depth
    with pytest.raises(CaptureError, match="no 'depth_file_path'"):
        trained(bare, TrainConfig(stop=SHORT, depth_weight=0.004))
    some = trained(
        [*bare[:3], *capture.frames[3:]], TrainConfig(stop=SHORT)
    ).gaussians.means.numpy()
    assert np.isfinite(some).all() and not np.array_equal(some, off.gaussians.means.numpy())


@pytest.mark.parametrize("factor", [np.nan, 1e6])
def test_wrong_depth_leaves_finite_gaussians(capture: Capture, factor: float) -> None:
    wrong = [
        frame.with_layer(Layer.DEPTH, np.float32(factor) * frame.load_depth())
        for frame in capture.frames
    ]
    gaussians = trained(wrong, TrainConfig(stop=SHORT, depth_weight=0.02)).gaussians.to_numpy()
    assert all(np.isfinite(getattr(gaussians, name)).all() for name in FIELDS)
