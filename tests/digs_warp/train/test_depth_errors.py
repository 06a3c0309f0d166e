"""The measured depth in the training: its errors, how closely the surface keeps to it, and its weight."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.rig import CameraMotion, Exposure
from digs_warp.splat.camera_motion import STILL, RowMotion
from digs_warp.splat.config import DepthOf, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import render
from digs_warp.splat.renderer import SplatRenderer
from digs_warp.splat.surface_depth import surface_depth
from digs_warp.train.adherence import adherence, load_measured_views
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.depth_errors import (
    CELLS,
    NO_ERRORS,
    NOISE_SHARE,
    TRUSTED_SPREAD,
    DepthJudge,
    cells_of,
    depth_samples,
)
from digs_warp.train.shutter import MotionPlan, Shutter
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from reference.tiny_capture import ball, drawn_depth
from reference.trained_ball import trained

OFFSET = -0.02  # [1/m]: at 1 m, depth is 2 cm too large
STEPS = 60
FRAMES = 6
# Of a view: each has 25 pixels.
REGIONS = 80


def seen(
    offset: float, noise: float = 0.003, of_regions: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True depths near 1 m, what a camera with an offset measures, and regions; a fifth is far off.

    ``noise`` [m] is that of pixels, ``of_regions`` that which all pixels of a region share.
    """
    rng = np.random.default_rng(0)
    true = rng.uniform(0.9, 1.1, 2000)
    cells = rng.permutation(2000) % REGIONS
    shared = rng.normal(0.0, of_regions, REGIONS)[cells]
    measured = 1.0 / (1.0 / true + offset) + rng.normal(0.0, noise, true.shape) + shared
    wrong = rng.uniform(size=true.shape) < 0.2
    return true, np.where(wrong, measured + rng.normal(0.0, 0.3, true.shape), measured), cells


def test_an_offset_is_found_over_all_views() -> None:
    judge = DepthJudge(5)
    for view in range(4):
        errors = judge.fit(view, *seen(OFFSET))
    assert errors.offset == pytest.approx(OFFSET, rel=0.05)
    one_alone = judge.fit(4, *seen(10 * OFFSET))
    assert one_alone.offset == pytest.approx(OFFSET, rel=0.05)


def test_what_errors_of_the_model_explain_is_no_offset() -> None:
    for share in (0.0, 0.5, 0.9):
        assert DepthJudge(1).fit(0, *seen(share * NOISE_SHARE)).offset == 0.0
    assert 0 < DepthJudge(1).fit(0, *seen(2 * NOISE_SHARE)).offset < 2 * NOISE_SHARE


def test_errors_of_regions_lower_the_weight_with_their_square() -> None:
    trust = DepthJudge(1).fit(0, *seen(OFFSET, 0.0, of_regions=6 * TRUSTED_SPREAD)).trust
    # The median is 0.67 deviations, and a little more with the outliers.
    assert (1 / 6) ** 2 < trust < (1 / (0.6 * 6)) ** 2
    in_scene = DepthJudge(1, 2 * TRUSTED_SPREAD).fit(0, *seen(OFFSET, 0.0, 6 * TRUSTED_SPREAD))
    assert in_scene.trust == pytest.approx(4 * trust)


def test_noise_of_pixels_does_not_lower_the_weight() -> None:
    for noise in (0.0, 3 * TRUSTED_SPREAD):
        assert DepthJudge(1).fit(0, *seen(OFFSET, noise)).trust == 1.0


def test_views_that_tell_nothing_change_nothing() -> None:
    judge = DepthJudge(2)
    few, cells = np.full(3, 1.0), np.zeros(3, int)
    assert judge.fit(0, few, 2 * few, cells) == NO_ERRORS
    found = judge.fit(1, *seen(OFFSET))
    assert judge.fit(0, few, 2 * few, cells) == found
    again = DepthJudge(2)
    again.restore(judge.state())
    assert again.errors == found


def test_cells_are_equal_parts_of_the_box() -> None:
    weights = np.zeros((70, 50), np.uint8)
    weights[5:65, 11:47] = 1  # 60 x 36 px: cells of 5 x 3
    samples = depth_samples(np.ones((70, 50), np.float32), weights)
    rows, columns = (samples.rows - 5) // 5, (samples.columns - 11) // 3
    assert np.array_equal(cells_of(samples), CELLS * rows + columns)


@pytest.mark.parametrize("wrong", ["everywhere", "in regions"])
def test_wrong_depth_does_not_pull_the_surface_along(capture: Capture, wrong: str) -> None:
    """The surface starts where the photographs see it, and depth is wrong by 1.5 %."""
    seen = [frame.with_layer(Layer.DEPTH, drawn_depth(frame)) for frame in capture.frames]
    factor = np.full(seen[0].load_depth().shape, 1.015, np.float32)
    if wrong == "in regions":
        rows, columns = np.indices(factor.shape)
        factor[(rows // 8 + columns // 8) % 2 == 1] = 0.985
    frames = [f.with_layer(Layer.DEPTH, factor * f.load_depth()) for f in seen]
    config = TrainConfig(depth_weight=0.1, stop=Stop(iterations=STEPS))
    moved = []
    for judged in (True, False):
        views = open_views(frames, config)
        trainer = Trainer(ball(), views, config)
        if not judged:
            trainer.depth_judge = None
        for _ in range(STEPS):
            trainer.step()
        views.close()
        moved.append(adherence(trainer.gaussians, load_measured_views(seen)))
    assert moved[0] is not None and moved[1] is not None
    assert moved[0] < 0.7 * moved[1]


def measured(frames: tuple[Frame, ...] | list[Frame], gaussians: Gaussians) -> float | None:
    return adherence(DeviceGaussians.from_numpy(gaussians), load_measured_views(frames))


def with_drawn_depth(frame: Frame, depth_of: DepthOf, rows: RowMotion = STILL) -> Frame:
    k, splats = frame.camera.intrinsics, DeviceGaussians.from_numpy(ball())
    options = RasterOptions(outputs="depth", depth_of=depth_of)
    renderer = SplatRenderer(splats, k.width, k.height, options=options)
    renderer.forward(frame.camera, near=0.01, rows=rows)
    return frame.with_layer(Layer.DEPTH, surface_depth(renderer.depth.to_numpy()))


def test_a_surface_that_slides_off_is_measured(capture: Capture) -> None:
    for off in (0.0, -0.007, 0.02):
        frames = [f.with_layer(Layer.DEPTH, drawn_depth(f) + off) for f in capture.frames]
        assert measured(frames, ball()) == pytest.approx(abs(off), abs=1e-6)
    assert measured([capture.frames[0], *frames[1:]], ball()) == pytest.approx(0.02, abs=1e-6)


def test_rows_are_drawn_from_where_they_were_read(capture: Capture) -> None:
    gaussians = DeviceGaussians.from_numpy(ball())
    moving = CameraMotion.of(np.array([0.4, 0.0, 0.0]), np.array([0.0, 1.5, 0.0]))
    plan = Shutter(MotionPlan(True, "", 0.05))
    frames = []
    for frame in capture.frames:
        frame = replace(frame, exposure=Exposure(moving))
        frames.append(with_drawn_depth(frame, "skin", plan.rows_of(frame) or STILL))
    known = adherence(gaussians, load_measured_views(frames, plan))
    ignored = adherence(gaussians, load_measured_views(frames))
    assert known is not None and ignored is not None
    assert known == pytest.approx(0.0, abs=1e-6)
    assert ignored > 1e-3


def test_without_masks_the_centers_lie_on_the_surface(capture: Capture) -> None:
    frames = [with_drawn_depth(f, "center").without_layer(Layer.MASK) for f in capture.frames]
    assert measured(frames, ball()) == pytest.approx(0.0, abs=1e-6)
    config = TrainConfig()
    for each, place in ((frames, "center"), (capture.frames, "skin")):
        trainer = Trainer(ball(50), open_views(each, config), config)
        assert trainer.renderer.middle.options.depth_of == place


def test_without_depth_there_is_no_figure(capture: Capture, tmp_path: Path) -> None:
    unknown = np.full_like(capture.frames[0].load_depth(), np.nan)
    assert measured([f.with_layer(Layer.DEPTH, unknown) for f in capture.frames], ball()) is None
    assert measured([], ball()) is None
    elsewhere = replace(ball(), means=ball().means + 50.0)
    assert measured(capture.frames, elsewhere) is None


SHORT = Stop(iterations=40)


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
