"""The edge length of the voxels that points are merged in: units, defaults, counts, and where it ends.

On a ball whose surface is known in closed form.
"""

import logging
from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.init import levels
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import Start, initialize
from reference.ball_capture import INTRINSICS, RADIUS
from reference.larger_world import larger


def radii(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points, axis=1)


def edge_length(found: Start) -> float:
    assert found.depth is not None
    return found.depth.voxel_size


@pytest.mark.parametrize("factor", [0.05, 30.0])
def test_the_default_voxel_is_two_pixels_whatever_the_size(
    ball_ring: Capture, factor: float
) -> None:
    frames = [larger(frame, factor) for frame in ball_ring.frames]
    found = initialize(frames, InitConfig())
    pixel = 0.75 / INTRINSICS.fx  # the middle of the ball's near side is 0.7 m away, its rim 0.85 m
    assert edge_length(found) == pytest.approx(2 * factor * pixel, rel=0.1)
    same = initialize(ball_ring.frames, InitConfig())
    assert len(found.points) == pytest.approx(len(same.points), rel=0.02)
    given = initialize(frames, InitConfig(voxel_size=0.02 * factor))
    assert edge_length(given) == 0.02 * factor


def test_the_default_voxel_grows_where_there_would_be_too_many_points(
    ball_ring: Capture, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = initialize(ball_ring.frames, InitConfig())
    wanted = len(usual.points) // 3
    monkeypatch.setattr(levels, "MOST_POINTS", wanted)
    caplog.set_level(logging.INFO)
    fewer = initialize(ball_ring.frames, InitConfig())
    assert 0.7 * wanted < len(fewer.points) <= wanted
    assert edge_length(fewer) > edge_length(usual)
    assert "--voxel-size" in caplog.text
    # Of images that show more than such voxels resolve, some of the pixels are read.
    monkeypatch.setattr(levels, "MOST_POINTS", len(usual.points) // 8)
    few = initialize(ball_ring.frames, InitConfig())
    assert few.depth is not None and usual.depth is not None
    assert 3 * few.depth.pixels["in the mask"] < usual.depth.pixels["in the mask"]
    np.testing.assert_allclose(radii(few.points.points_world), RADIUS, atol=0.01)
    # What somebody asks for is not corrected.
    fine = initialize(ball_ring.frames, InitConfig(voxel_size=edge_length(usual)))
    assert len(fine.points) == len(usual.points)


@pytest.mark.parametrize("wanted", [50, 1500])
def test_the_voxel_size_for_a_number_of_points(ball_ring: Capture, wanted: int) -> None:
    found = initialize(ball_ring.frames, InitConfig(target_points=wanted))
    assert 0.7 * wanted < len(found.points) <= wanted
    np.testing.assert_allclose(radii(found.points.points_world), RADIUS, atol=0.02)


def test_a_world_far_from_its_origin(ball_ring: Capture) -> None:
    """Recordings in geographic coordinates have their object a thousand kilometres away."""
    shift = np.eye(4)
    shift[:3, 3] = [1e6, -1e6, 1e3]
    moved = [
        replace(f, camera=replace(f.camera, world_from_cam=shift @ f.camera.world_from_cam))
        for f in ball_ring.frames
    ]
    points = initialize(moved, InitConfig(voxel_size=1.0)).points.points_world
    assert 8 <= len(points) <= 16
    assert np.abs(points - shift[:3, 3]).max() < 0.3
    with pytest.raises(DigsError, match="too small for a camera"):
        initialize(moved, InitConfig(voxel_size=0.004))
