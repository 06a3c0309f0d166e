"""The exposure of a held-out photograph, told by its neighbors in time."""

from pathlib import Path

import numpy as np

from digs_warp.data.images import linear_from_srgb, srgb_from_linear, to_uint8
from digs_warp.data.layers import Layer
from digs_warp.measure.color_gain import ColorGain
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.evaluate import load_test_views, measure_views
from reference.tiny_capture import ball, write_tiny_capture
from studies.recordings import interpolated, psnr_by_neighbors


def test_neighbors_in_time_tell_the_exposure(tmp_path: Path) -> None:
    frames = write_tiny_capture(tmp_path / "capture", frames=8).frames
    light = [linear_from_srgb(frame.load_image() / 255.0) for frame in frames]
    photographs = [
        frame.with_layer(Layer.IMAGE, to_uint8(srgb_from_linear(each * 2.0**stops)))
        for frame, each, stops in zip(frames, light, np.linspace(-0.9, 0.3, 8), strict=True)
    ]
    held_out = [photographs[number] for number in (2, 5)]
    training = [frame for frame in photographs if frame not in held_out]
    scene = DeviceGaussians.from_numpy(ball())
    scores = measure_views(scene, load_test_views(held_out)).scores
    found = psnr_by_neighbors(scene, training[::-1], held_out)
    assert found > np.mean([score.psnr_object_aligned for score in scores]) - 0.5
    assert found > np.mean([score.psnr_object for score in scores]) + 3
    gains = [ColorGain(np.full(3, 0.2)), ColorGain(np.full(3, 0.1))]
    first = interpolated(np.array([3.0, 1.0]), gains, 0.0)
    np.testing.assert_allclose(first.log_factors, [0.1, 0.1, 0.1])
