"""A still camera before a turning object, whose poses follow the object: no scene comes of it."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.pipeline.config import FrontEndConfig
from digs_warp.pipeline.front_end import front_end
from digs_warp.record.run_log import RunLog


def test_a_smear_is_refused_before_any_work(tmp_path: Path) -> None:
    k, rng = Intrinsics.from_fov(160, 120, 50.0), np.random.default_rng(0)
    surroundings, frames = rng.integers(0, 256, (30, 40, 3)), []
    for number in range(8):
        small = surroundings.copy()
        small[10:20, 15:25] = rng.integers(0, 256, (10, 10, 3))  # the object has turned
        image = small.repeat(4, axis=0).repeat(4, axis=1).astype(np.uint8)
        angle = 2 * np.pi * number / 8
        eye = np.array([np.cos(angle), np.sin(angle), 0.3])
        camera = Camera(k, look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])))
        layers = {Layer.IMAGE: image, Layer.DEPTH: np.ones((120, 160), np.float32)}
        frames.append(Frame(f"{number:04d}", camera, float(number), layers))
    capture = Capture(None, tuple(frames), None)
    with pytest.raises(DigsError, match=r"stands still.*masks.*--poses auto.*--ignore-mask"):
        front_end(capture, FrontEndConfig(), tmp_path, RunLog("test", {}))
