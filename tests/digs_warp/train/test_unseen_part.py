"""What held-out views show that no training view sees is measured apart."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.geometry.rigid import rigid
from digs_warp.train.evaluate import MeasuredViews, load_test_views
from digs_warp.train.unseen_part import unseen_part
from reference.tiny_capture import HEIGHT, WIDTH, write_tiny_capture


def before_a_wall(frame: Frame, shift: float) -> Frame:
    """The frame, 2 m before a wall, moved along it by a share of what it shows of it; white, no mask."""
    k = frame.camera.intrinsics
    pose = rigid(np.eye(3), np.array([shift * 2.0 * k.width / k.fx, 0.0, 0.0]))
    frame = replace(frame, camera=replace(frame.camera, world_from_cam=pose)).without_layer(
        Layer.MASK
    )
    frame = frame.with_layer(Layer.IMAGE, np.full((HEIGHT, WIDTH, 3), 255, np.uint8))
    return frame.with_layer(Layer.DEPTH, np.full((HEIGHT, WIDTH), 2.0, np.float32))


@pytest.mark.parametrize(
    ("shift", "nearer", "share"), [(0.5, 1.0, 0.5), (0.5, 0.5, 1.0), (0.0, 1.0, 0)]
)
def test_the_share_that_no_training_view_sees(
    tmp_path: Path, shift: float, nearer: float, share: float
) -> None:
    first, second = write_tiny_capture(tmp_path, frames=2).frames
    training, aside = before_a_wall(first, 0.0), before_a_wall(second, shift)
    hiding = training.load_depth() * np.float32(nearer)  # something before the wall hides it all
    frames = PosedFrames((training.with_layer(Layer.DEPTH, hiding),), (aside,))
    image = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    image[:, WIDTH // 2 :] = 204  # what the training did not see is off by a fifth
    measured = MeasuredViews([image], [np.zeros((1, 1))], [])
    found = unseen_part(measured, frames, load_test_views((aside,)))
    if not share:
        assert found is None
        return
    assert found is not None and found.share == pytest.approx(share, abs=0.05)
    if share == 0.5:
        assert found.psnr_unseen == pytest.approx(-20 * np.log10(0.2), abs=0.01)
        assert found.psnr_seen > found.psnr_unseen + 10
