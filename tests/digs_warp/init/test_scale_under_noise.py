"""The recovered scale under the simulator's sensor effects, and under calibration errors.

Sparse points come from the truth, in an arbitrary unit, with noisy and mismatched features.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.images import to_uint8, write_image
from digs_warp.data.layers import Layer
from digs_warp.data.rig import Rig
from digs_warp.data.sfm_model import SfmModel
from digs_warp.init.config import InitConfig
from digs_warp.init.scale import MIN_MASKED, estimate_scale, local_scales
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.frame import FrameTruth
from reference.sensed import NAMES, sensed_depth
from reference.synthetic_sfm import sfm_from_truth

TRUE = 1.37
FRAMES = 4


@dataclass(frozen=True)
class Recording:
    """The truth of a few views, as the sensor's effects take it, and as a capture."""

    truths: list[FrameTruth]
    frames: tuple[Frame, ...]
    sfm: SfmModel

    def sensed(self, folder: Path, sense: Callable[[FrameTruth], np.ndarray]) -> list[Frame]:
        """The frames with other depth."""
        changed = []
        for frame, truth in zip(self.frames, self.truths, strict=True):
            path = folder / f"{frame.name}.exr"
            write_image(path, sense(truth))
            changed.append(frame.with_layer(Layer.DEPTH, path))
        return changed

    def scale(self, frames: Sequence[Frame]) -> float:
        """The recovered scale as a multiple of the true one."""
        ratios = local_scales(self.sfm, frames, InitConfig())
        return estimate_scale(ratios).sfm_per_metre / TRUE


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    # At 640 px a disparity is about 70 px: 0.07 px is a thousandth.
    config = SimulateConfig(
        profile="bare-matcher", frames=FRAMES, width=640, samples_per_pixel=1, ground="none"
    )
    session = prepare_session(config, load_inputs(config))
    k = session.rig.intrinsics
    writer = CaptureWriter(tmp_path_factory.mktemp("truth"), k, Rig(session.rig.baseline))
    truths = []
    for number in range(FRAMES):
        truth, objects = session.truth(number, Shutter())
        image = to_uint8(truth.image)
        writer.write_frame(
            number, FrameImages(image, truth.depth, objects.mask, depth_true=truth.depth)
        )
        writer.add_pose(number, truth.camera.world_from_cam, float(number))
        truths.append(truth)
    frames = writer.finish().frames
    return Recording(truths, frames, sfm_from_truth(frames, TRUE, points=4000))


@pytest.mark.parametrize(("strength", "bound"), [(1, 2e-3), (2, 5e-3), (4, 2e-2)])
def test_all_effects_together(
    recording: Recording, tmp_path: Path, strength: float, bound: float
) -> None:
    def sense(truth: FrameTruth) -> np.ndarray:
        return sensed_depth(truth, NAMES, strength)

    assert recording.scale(recording.sensed(tmp_path, sense)) == pytest.approx(1.0, abs=bound)


def test_without_enough_texture_on_the_object_the_whole_image_counts(
    recording: Recording, caplog: pytest.LogCaptureFixture
) -> None:
    few = sfm_from_truth(recording.frames, TRUE, points=300)
    ratios = local_scales(few, recording.frames, InitConfig())
    assert "inside the masks" in caplog.text
    assert len(ratios) > MIN_MASKED
    assert estimate_scale(ratios).sfm_per_metre == pytest.approx(TRUE, rel=1e-4)


def test_held_out_frames_do_not_serve(recording: Recording, tmp_path: Path) -> None:
    spoiled = recording.sensed(tmp_path, lambda truth: 2 * truth.depth)
    training = [*recording.frames[1:]]
    assert recording.scale(training) == pytest.approx(1.0, abs=1e-4)
    assert recording.scale(spoiled[:1]) == pytest.approx(0.5, abs=1e-3)


def test_frames_that_were_not_registered_raise(recording: Recording) -> None:
    strangers = [replace(frame, name="x" + frame.name) for frame in recording.frames]
    with pytest.raises(DigsError, match="registered none of the 4 training frames"):
        local_scales(recording.sfm, strangers, InitConfig())
