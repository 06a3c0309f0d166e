"""Recordings of a color camera beside an infrared pair: their layers, files and order of making."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import read_capture
from digs_warp.data.layers import INFRARED_LAYERS, Layer
from digs_warp.data.rig import InfraredPair, Rig
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker, layers_of
from digs_warp.sim.record.record import simulate, simulate_in_memory
from digs_warp.sim.record.stream import stream
from digs_warp.sim.sensor.filters import gray_of

CONFIG = SimulateConfig(
    profile="d435", frames=3, width=160, samples_per_pixel=1, tier="guided", seed=5
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("infrared") / "capture"
    simulate(CONFIG, folder)
    return folder


def test_images_depth_and_mask_are_the_color_cameras(recording: Path) -> None:
    capture = read_capture(recording)
    rig = FrameMaker.of(CONFIG).session.rig
    k = rig.image_intrinsics
    assert k.fx == pytest.approx(1.444 * rig.intrinsics.fx)
    for frame in capture.frames:
        assert frame.camera.intrinsics == k
        assert not frame.has(Layer.RIGHT)
        on_object = frame.load_mask() == 255
        error = frame.load_depth() - frame.load_depth_true()
        known = np.isfinite(error)
        assert known.mean() > 0.85
        disparity = rig.focal_baseline * np.abs(error) / frame.load_depth_true() ** 2
        assert np.median(disparity[known & on_object]) < 0.5
        # Mask and true depth belong together; at the rim, one ray decides on either.
        assert np.mean(frame.load_depth_true()[on_object] < 1.5) > 0.95


def test_readers_know_where_the_pair_is_and_do_not_take_it_for_a_right_image(
    recording: Path,
) -> None:
    capture = read_capture(recording)
    k = FrameMaker.of(CONFIG).session.rig.intrinsics
    assert capture.rig == Rig(0.05, InfraredPair(0.015, k.fx, k.fy, k.cx, k.cy))
    assert capture.right_offset is None
    with pytest.raises(CaptureError, match="has no 'right_file_path'"):
        capture.frames[0].load_right_image()
    left, right = capture.frames[0].load_infrared()
    assert left.shape == right.shape == (k.height, k.width) and left.dtype == np.uint8
    assert (left != right).mean() > 0.5


def test_the_pair_shows_the_scene_at_the_stated_place(recording: Path) -> None:
    frame = read_capture(recording).frames[0]
    maker = FrameMaker.of(CONFIG)
    truth, _ = maker.session.truth(0, Shutter(), projects=maker.plan.projects)
    left, right = frame.load_infrared()
    for infrared, eye in ((left, truth.image), (right, truth.right)):
        inside = gray_of(eye).astype(float)
        assert np.corrcoef(infrared.ravel(), inside.ravel())[0, 1] > 0.95
    place = frame.camera.cam_from_world @ np.append(truth.camera.center_world, 1)
    np.testing.assert_allclose(place[:3], [0.015, 0, 0], atol=1e-12)


def test_without_the_projector_only_the_pair_and_its_depth_change(
    tmp_path: Path, recording: Path
) -> None:
    on = read_capture(recording)
    names = [name for name in on.about.effects or () if name != "projector"]
    simulate(replace(CONFIG, effects=",".join(names)), tmp_path)
    off = read_capture(tmp_path)
    for lit, dark in zip(on.frames, off.frames, strict=True):
        for layer in INFRARED_LAYERS:
            same = lit.path(layer).read_bytes() == dark.path(layer).read_bytes()
            pair = (Layer.INFRARED_LEFT, Layer.INFRARED_RIGHT, Layer.DEPTH)
            assert same == (layer not in pair), layer


def test_perfect_depth_is_the_color_cameras_own() -> None:
    config = replace(CONFIG, tier="truth", frames=1)
    (frame,) = simulate_in_memory(config).frames
    assert set(layers_of(config, 0)) == set(frame.layers)
    np.testing.assert_array_equal(frame.load_depth(), frame.load_depth_true())


def test_a_stream_has_the_pair() -> None:
    frame = next(stream(replace(CONFIG, frames=1)))
    assert frame.right is None and frame.infrared is not None
    assert frame.infrared[0].shape == frame.depth.shape == frame.left.shape[:2]
