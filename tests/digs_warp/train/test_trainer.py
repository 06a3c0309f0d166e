"""The training loop: it learns, and it says when it cannot go on."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import FIELDS, Gaussians, joined
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views, view_index
from reference.tiny_capture import RADIUS, ball
from reference.trained_ball import trained


def test_the_background_supervises_the_outside(capture: Capture) -> None:
    """Its color changes, so that stray Gaussians of any color vanish."""
    stray = ball(count=60)
    stray = replace(stray, means=stray.means * 1.7, sh=np.full_like(stray.sh, 1.7724))  # white
    config = TrainConfig(stop=Stop(iterations=120), sh_degree=0)
    found = trained(capture.frames, config, joined([ball(), stray])).gaussians.to_numpy()
    outside = np.linalg.norm(found.means, axis=1) > 1.4 * RADIUS
    assert outside.any() and np.median(found.opacities[outside]) < 0.5


def test_every_view_is_seen_once_an_epoch() -> None:
    seen = [view_index(0, 8, step) for step in range(16)]
    assert sorted(seen[:8]) == sorted(seen[8:]) == list(range(8))
    assert seen[:8] not in (seen[8:], [view_index(1, 8, step) for step in range(8)])


def test_no_gaussians_and_no_views_are_refused(capture: Capture) -> None:
    config = TrainConfig()
    nothing = Gaussians(*(getattr(ball(), name)[:0] for name in FIELDS))
    with pytest.raises(DigsError, match="no Gaussians"):
        Trainer(nothing, open_views(capture.frames, config), config)
    with pytest.raises(DigsError, match="no training views"):
        open_views([], config)
