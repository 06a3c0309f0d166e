"""Depth in the image of the color camera, against a slow twin and against the geometry of the scene."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Scene
from digs_warp.sim.sensor.frame import Cause, FrameTruth, Sensed
from digs_warp.sim.sensor.infrared.registration import ColorView, registered, sources_of
from reference.infrared_scenes import WHITE, infrared_rig, still_session, wall
from reference.plates import plate
from reference.registration_twin import register

NEAR, FAR = 0.5, 1.0


def taken(depth: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The depth at the sources; NaN where there is none."""
    return np.where(source < 0, np.nan, depth.reshape(-1)[source])


@pytest.mark.parametrize(("zoom", "offset"), [(1.444, -0.015), (1.0, 0.02), (0.8, -0.03)])
def test_every_pixel_is_the_slow_twins(zoom: float, offset: float) -> None:
    rig = infrared_rig(22, color_zoom=zoom, color_offset=offset)
    shape = rig.intrinsics.height, rig.intrinsics.width
    rng = np.random.default_rng(3)
    depth = rng.choice([0.3, 0.31, 0.7, 1.9, np.nan, np.inf, -np.inf], shape).astype(np.float32)
    depth *= rng.uniform(0.99, 1.01, shape).astype(np.float32)
    found = taken(depth, sources_of(depth, rig))
    np.testing.assert_array_equal(found, register(depth, rig))
    assert 0.3 < np.isfinite(found).mean() < 1


def perfect(scene: Scene) -> tuple[Sensed, FrameTruth, ColorView]:
    """A scene as a perfect pair measures it."""
    session = still_session(scene, infrared_rig())
    truth, _ = session.truth(0, Shutter())
    return Sensed.of(truth), truth, session.color_view(0, Shutter())


def test_a_slanted_wall_is_where_the_color_camera_sees_it() -> None:
    sensed, truth, view = perfect(wall(FAR, slope=0.6))
    found = registered(sensed, truth, view)
    assert np.isfinite(found.depth).all()
    # Points go to where they are seen: a depth pixel is 1.44 color pixels wide.
    error = found.depth - view.depth
    per_pixel = np.abs(np.diff(view.depth, axis=1)).max()
    assert np.abs(error).max() <= 2.5 * per_pixel
    assert abs(error.mean()) < 0.6 * per_pixel
    # With the color camera on the other side of the eye, points would be 9 pixels away.
    turned = replace(truth, rig=replace(truth.rig, color_offset=-truth.rig.color_offset))
    wrong = np.abs(registered(sensed, turned, view).depth - view.depth)
    assert np.nanmedian(wrong) > 4 * np.median(np.abs(error))
    assert (found.cause == Cause.OK).mean() > 0.99


def test_a_near_thing_leaves_a_shadow_of_the_known_width_on_the_side_of_the_color_camera() -> None:
    screen = plate((0, 0, NEAR), (0.08, 0, 0), (0, -0.1, 0), WHITE)
    sensed, truth, view = perfect(join_scenes(wall(FAR), screen))
    found = registered(sensed, truth, view)
    row = found.depth[truth.depth.shape[0] // 2]
    empty = np.flatnonzero(np.isnan(row))
    rig = truth.rig
    width = rig.image_intrinsics.fx * abs(rig.color_offset) * (1 / NEAR - 1 / FAR)
    assert len(empty) == pytest.approx(width, abs=1.6)
    on_screen = np.flatnonzero(row < (NEAR + FAR) / 2)
    assert empty.max() == on_screen.min() - 1  # the color camera sits to the left of the eye
    assert (found.cause[truth.depth.shape[0] // 2, empty] == Cause.OCCLUDED).all()
    assert (found.confidence[truth.depth.shape[0] // 2, empty] == 0).all()
    # Near things grow by a pixel at most.
    truly = np.flatnonzero(view.depth[truth.depth.shape[0] // 2] < (NEAR + FAR) / 2)
    assert 0 <= truly.min() - on_screen.min() <= 2 and 0 <= on_screen.max() - truly.max() <= 2


def test_holes_confidence_and_causes_come_along() -> None:
    sensed, truth, view = perfect(wall(FAR))
    lost = np.zeros(truth.depth.shape, bool)
    lost[100:140, 180:230] = True
    near = np.zeros_like(lost)
    near[60:80, 180:230] = True
    sensed = replace(sensed, confidence=np.full(lost.shape, 0.25, np.float32))
    sensed = sensed.with_holes(lost, Cause.SPECULAR).with_holes(near, Cause.NEAR)
    found = registered(sensed, truth, view)
    assert np.isneginf(found.depth).sum() > 0.8 * near.sum() * truth.rig.color_zoom**2
    hole = np.isnan(found.depth)
    assert 0.8 < hole.sum() / (lost.sum() * truth.rig.color_zoom**2) <= 1
    assert (found.cause[hole] == Cause.SPECULAR).all()
    assert (found.confidence[~np.isfinite(found.depth)] == 0).all()
    assert (found.confidence[np.isfinite(found.depth)] == 0.25).all()
