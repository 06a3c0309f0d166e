"""How closely the surface keeps to the measured depth: on a ball whose depth is known exactly."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.rig import CameraMotion, Exposure
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from digs_warp.splat.surface_depth import surface_depth
from digs_warp.train.adherence import adherence, load_measured_views
from digs_warp.train.config import TrainConfig
from digs_warp.train.shutter import MotionPlan, Shutter
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from reference.tiny_capture import ball, drawn_depth

FRAMES = 6


def measured(frames: tuple[Frame, ...] | list[Frame], gaussians: Gaussians) -> float | None:
    return adherence(DeviceGaussians.from_numpy(gaussians), load_measured_views(frames))


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
        k = frame.camera.intrinsics
        options = RasterOptions(outputs="depth", depth_of="skin")
        renderer = SplatRenderer(gaussians, k.width, k.height, options=options)
        renderer.forward(frame.camera, near=0.01, rows=plan.rows_of(frame))
        frames.append(frame.with_layer(Layer.DEPTH, surface_depth(renderer.depth.to_numpy())))
    known = adherence(gaussians, load_measured_views(frames, plan))
    ignored = adherence(gaussians, load_measured_views(frames))
    assert known is not None and ignored is not None
    assert known == pytest.approx(0.0, abs=1e-6)
    assert ignored > 1e-3


def test_without_masks_the_centers_lie_on_the_surface(capture: Capture) -> None:
    gaussians = DeviceGaussians.from_numpy(ball())
    frames = []
    for frame in capture.frames:
        k = frame.camera.intrinsics
        options = RasterOptions(outputs="depth", depth_of="center")
        renderer = SplatRenderer(gaussians, k.width, k.height, options=options)
        renderer.forward(frame.camera, near=0.01)
        depth = surface_depth(renderer.depth.to_numpy())
        frames.append(frame.with_layer(Layer.DEPTH, depth).without_layer(Layer.MASK))
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
