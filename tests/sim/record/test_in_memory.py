"""A recording in memory, and a stream of frames, hold what the capture folder holds."""

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate, simulate_in_memory
from digs_warp.sim.record.stream import stream

CONFIGS = (
    SimulateConfig(profile="bare-matcher", frames=2, width=64, labels="all"),
    SimulateConfig(profile="bare-matcher", frames=2, width=64, tier="truth"),
)


@pytest.fixture(scope="module", params=CONFIGS, ids=lambda config: config.tier)
def config(request: pytest.FixtureRequest) -> SimulateConfig:
    return request.param


@pytest.fixture(scope="module")
def stored(config: SimulateConfig, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return simulate(config, tmp_path_factory.mktemp("recording") / "capture")


def test_memory_holds_what_the_folder_holds(config: SimulateConfig, stored: Capture) -> None:
    capture = simulate_in_memory(config)
    assert (capture.rig, capture.about, len(capture)) == (stored.rig, stored.about, len(stored))
    for here, there in zip(capture.frames, stored.frames, strict=True):
        assert (here.name, here.time) == (there.name, there.time)
        assert here.camera.intrinsics == there.camera.intrinsics
        np.testing.assert_array_equal(here.camera.world_from_cam, there.camera.world_from_cam)
        assert here.layers.keys() == there.layers.keys()
        for layer in here.layers:
            pixels, expected = here.load(layer), there.load(layer)
            assert pixels.dtype == expected.dtype
            np.testing.assert_array_equal(pixels, expected)


def test_the_stream_gives_the_same_frames(config: SimulateConfig, stored: Capture) -> None:
    for frame, there in zip(stream(config), stored.frames, strict=True):
        assert f"{frame.number:04d}" == there.name and frame.time == there.time
        np.testing.assert_array_equal(frame.camera.world_from_cam, there.camera.world_from_cam)
        np.testing.assert_array_equal(frame.left, there.load_image())
        np.testing.assert_array_equal(frame.right, there.load_right_image())
        np.testing.assert_array_equal(frame.depth, there.load_depth())
        np.testing.assert_array_equal(frame.depth_true, there.load_depth_true())
        np.testing.assert_array_equal(frame.mask, there.load_mask())
        assert (frame.cause is not None) == there.has(Layer.CAUSE)
        if frame.cause is not None:
            np.testing.assert_array_equal(frame.cause, there.load_cause())


def test_a_capture_in_memory_has_no_folder() -> None:
    capture = Capture(None, (), None)
    assert str(capture) == "capture in memory"
    with pytest.raises(CaptureError, match="in memory: this needs a capture folder"):
        _ = capture.folder
