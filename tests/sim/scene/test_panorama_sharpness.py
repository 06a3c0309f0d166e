"""Panoramas that are too coarse for the images that show them."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.images import write_image
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.builtin import builtin_scene
from digs_warp.sim.scene.environment import (
    SOFT,
    Environment,
    pixels_per_texel,
    warn_if_soft,
)

DISTANCE = 1.0
RIG = load_profile("zed2-720").rig(320, 180)


def striped(height: int) -> Environment:
    """Return a panorama with stripes eight texels wide."""
    stripes = np.where(np.arange(2 * height) // 8 % 2, 1.0, 0.1)
    radiance = np.broadcast_to(stripes[:, None], (height, 2 * height, 3))
    return Environment(np.ascontiguousarray(radiance, np.float32), radius=3.0)


def test_texels_are_as_wide_as_they_are_in_the_image() -> None:
    environment = striped(256)
    scene = builtin_scene()
    speck = replace(scene, vertices=scene.vertices * np.float32(0.01))
    # Looking past the speck, level with the middle of the panorama: at the far side of the sphere.
    pose = look_at(np.array([DISTANCE, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    camera = Camera(RIG.intrinsics, pose)
    image, _ = RaycastRenderer(speck, environment).render_image(camera, samples_per_pixel=16)
    row = image[RIG.intrinsics.height // 2 + 10].astype(float).mean(axis=1)
    middle = slice(RIG.intrinsics.width // 3, 2 * RIG.intrinsics.width // 3)
    steps = np.flatnonzero(np.diff((row > (row.min() + row.max()) / 2).astype(int)))
    steps = steps[(steps > middle.start) & (steps < middle.stop)]
    assert len(steps) > 2
    width = (steps[-1] - steps[0]) / (len(steps) - 1) / 8
    assert width == pytest.approx(pixels_per_texel(environment, RIG, DISTANCE), rel=0.08)


def test_a_coarse_panorama_is_warned_of_and_a_fine_one_is_not(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.WARNING):
        warn_if_soft(striped(1024), RIG, DISTANCE)
    assert not caplog.records
    coarse = striped(64)
    with caplog.at_level(logging.WARNING):
        warn_if_soft(coarse, RIG, DISTANCE)
    (message,) = caplog.messages
    assert "128 x 64" in message
    advised = int(message.split("panorama of ")[1].split(" x ")[0])
    assert pixels_per_texel(striped(advised // 2), RIG, DISTANCE) <= SOFT


def test_a_floor_near_by_counts() -> None:
    sphere = striped(256)
    floor = Environment(sphere.radiance, radius=6.0, floor=-0.1)
    near = pixels_per_texel(floor, RIG, 0.5)
    assert near > 2 * pixels_per_texel(sphere, RIG, 0.5)
    assert near == pytest.approx(2 * pixels_per_texel(floor, RIG, 1.0), rel=0.05)


def test_a_recording_warns_of_it_and_knows_its_ground(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "sky.png"
    write_image(path, np.full((8, 16, 3), 128, np.uint8))
    settings = SimulateConfig(
        environment=path, ground="table", frames=1, width=32, samples_per_pixel=1, tier="truth"
    )
    with caplog.at_level(logging.WARNING):
        capture = simulate_in_memory(settings)
    assert "looks soft" in caplog.text and capture.about.ground == "table"
