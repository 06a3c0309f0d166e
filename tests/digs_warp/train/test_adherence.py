"""How closely the surface keeps to the measured depth: on a ball whose depth is known exactly."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import render
from digs_warp.train.adherence import adherence, load_measured_views
from reference.tiny_capture import RADIUS, ball, write_tiny_capture


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("tiny") / "capture", frames=6)


def grown(gaussians: Gaussians, factor: float) -> Gaussians:
    return Gaussians(
        gaussians.means * factor,
        gaussians.log_scales,
        gaussians.quats,
        gaussians.opacity_logits,
        gaussians.sh,
    )


def measured(frames: tuple[Frame, ...] | list[Frame], gaussians: Gaussians) -> float | None:
    return adherence(DeviceGaussians.from_numpy(gaussians), load_measured_views(frames))


def test_is_the_median_over_the_object_in_all_views(capture: Capture) -> None:
    distances = []
    for frame in capture.frames:
        drawn = render(ball(), frame.camera, options=RasterOptions(outputs="depth")).median_depth
        assert drawn is not None
        distance = np.abs(drawn - frame.load_depth())[frame.load_mask() >= 128]
        distances.append(distance[np.isfinite(distance)])
    assert measured(capture.frames, ball()) == pytest.approx(np.median(np.concatenate(distances)))


def test_a_surface_that_slides_off_is_measured(capture: Capture) -> None:
    near = measured(capture.frames, ball())
    far = measured(capture.frames, grown(ball(), 0.9))
    assert near is not None and far is not None
    # Seen from the front, a ball smaller by a tenth lies a tenth of the radius behind, more at the sides.
    assert near < 0.05 * RADIUS
    assert 0.1 * RADIUS < far < 0.2 * RADIUS


def test_wrong_pixels_do_not_change_it_much(capture: Capture) -> None:
    spoilt = []
    for frame in capture.frames:
        depth = frame.load_depth()
        depth[::5] *= 10.0
        depth[1::5] = np.nan
        spoilt.append(frame.with_layer(Layer.DEPTH, depth))
    usual = measured(capture.frames, ball())
    assert usual is not None
    assert measured(spoilt, ball()) == pytest.approx(usual, abs=0.003)


def test_without_depth_there_is_no_figure(capture: Capture, tmp_path: Path) -> None:
    unknown = np.full_like(capture.frames[0].load_depth(), np.nan)
    assert measured([f.with_layer(Layer.DEPTH, unknown) for f in capture.frames], ball()) is None
    assert measured([], ball()) is None
    elsewhere = grown(ball(), 1.0)
    elsewhere.means[:, 2] += 50.0
    assert measured(capture.frames, elsewhere) is None
