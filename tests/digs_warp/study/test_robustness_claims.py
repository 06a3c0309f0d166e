"""What the robustness study claims, at a size for the suite: errors of depth may blur, but break nothing."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import FIELDS
from digs_warp.data.images import to_uint8, write_image
from digs_warp.data.layers import Layer
from digs_warp.data.rig import Rig
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seeds import seed_gaussians
from digs_warp.measure.scores import mean_score
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.train import evaluate
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from reference.sensed import NAMES, sensed_depth

# The most that an effect may cost at four times its real strength [dB].
WORST = 1.0
FRAMES, STEPS = 8, 30
INIT = InitConfig(voxel_size=0.015)
TRAIN = TrainConfig(stop=Stop(iterations=STEPS), sh_degree=0)


@dataclass(frozen=True)
class Walk:
    """Views with perfect photographs and depth; every fourth is held out."""

    truths: list[FrameTruth]
    frames: tuple[Frame, ...]
    held_out: Sequence[evaluate.TestView]

    def quality(
        self, folder: Path, effects: Sequence[str], strength: float, seed: int = 0
    ) -> float:
        """The PSNR [dB] of held-out views after a short training from depth with errors."""
        frames = []
        for number, (frame, truth) in enumerate(zip(self.frames, self.truths, strict=True)):
            if number % 4:
                depth = sensed_depth(truth, effects, strength, seed)
                path = folder / f"{frame.name}.exr"
                write_image(path, depth)
                frames.append(frame.with_layer(Layer.DEPTH, path))
        points = initial_points(frames, INIT)
        seeds = seed_gaussians(points, TRAIN.usual_sh_degree, INIT.seed_opacity, INIT.seed_width)
        trainer = Trainer(seeds, open_views(frames, TRAIN), TRAIN)
        for _ in range(STEPS):
            trainer.step()
        trained = trainer.gaussians.to_numpy()
        assert all(np.isfinite(getattr(trained, name)).all() for name in FIELDS)
        renderings = evaluate.render_views(trainer.gaussians, self.held_out)
        psnr = mean_score(evaluate.score_views(renderings, self.held_out)).psnr_object
        assert psnr is not None
        return psnr


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Walk:
    config = SimulateConfig(frames=FRAMES, width=192, height=108, samples_per_pixel=1)
    session = prepare_session(config, load_inputs(config))
    writer = CaptureWriter(
        tmp_path_factory.mktemp("truth"), session.rig.intrinsics, Rig(session.rig.baseline)
    )
    truths = []
    for number in range(FRAMES):
        truth, objects = session.truth(number, Shutter())
        writer.write_frame(number, FrameImages(to_uint8(truth.image), truth.depth, objects.mask))
        writer.add_pose(number, truth.camera.world_from_cam, float(number))
        truths.append(truth)
    frames = writer.finish().frames
    return Walk(truths, frames, evaluate.load_test_views(frames[::4]))


@pytest.fixture(scope="module")
def clean(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> float:
    return walk.quality(tmp_path_factory.mktemp("clean"), [], 1.0)


def test_the_short_training_is_worth_something(clean: float) -> None:
    assert clean > 24.0


@pytest.mark.parametrize("name", NAMES)
def test_four_times_an_effect_costs_no_more_than_its_bound(
    walk: Walk, clean: float, tmp_path: Path, name: str
) -> None:
    assert walk.quality(tmp_path, [name], 4.0) > clean - WORST


@pytest.mark.parametrize(("strength", "bound"), [(1.0, 1.5), (4.0, 9.0)])
def test_all_effects_together_cost_no_more_than_their_bound(
    walk: Walk, clean: float, tmp_path: Path, strength: float, bound: float
) -> None:
    # A single draw may put a stray point before a camera, which costs decibels.
    found = [walk.quality(tmp_path, NAMES, strength, seed) for seed in range(3)]
    assert np.median(found) > clean - bound


def test_depth_of_which_nothing_is_left_is_told(walk: Walk, tmp_path: Path) -> None:
    blind = [replace(truth, depth=np.full_like(truth.depth, np.nan)) for truth in walk.truths]
    with pytest.raises(DigsError, match="no points in"):
        replace(walk, truths=blind).quality(tmp_path, [], 1.0)
