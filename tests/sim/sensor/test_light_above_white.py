"""Light above white: a shorter exposure shows it, where the renderer knows it."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.views import CameraTrack
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.color import AUTO_EXPOSURE, WHITE_BALANCE
from digs_warp.sim.sensor.color.adaptation import Adaptation
from digs_warp.sim.sensor.color.encoding import encode
from digs_warp.sim.sensor.color.protocol import PixelEffect
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.highlights import Highlights
from reference.plates import plate
from reference.stereo_frames import make_frame, make_rig

POSE = look_at(np.array([0.0, -2.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
SHORTER = Adaptation(exposure=-1.0)


def clipped(is_known: bool = True) -> FrameTruth:
    """Gray on the left, light of 1.6 on the right, which the image shows as white."""
    image = np.full((6, 8, 3), 100, np.uint8)
    image[:, 4:] = 255
    light = np.where(np.arange(48) % 8 < 4, 0.127, 1.6)[:, None] * np.ones(3)
    known = Highlights.of(image, light) if is_known else None
    truth = make_frame(25.0, make_rig(8, 6), image)
    return replace(truth, right=image, highlights=known, right_highlights=known)


@pytest.mark.parametrize(
    ("effects", "is_known", "expected"),
    [
        ((AUTO_EXPOSURE,), True, 0.8),
        ((AUTO_EXPOSURE,), False, 1.0),  # nobody knows how bright it was
        ((WHITE_BALANCE,), True, 1.0),  # the sensor has clipped it before
        ((AUTO_EXPOSURE, WHITE_BALANCE), True, 0.8),
    ],
)
def test_half_the_exposure_shows_light_up_to_twice_white(
    effects: tuple[PixelEffect, ...], is_known: bool, expected: float
) -> None:
    for recorded in recorded_images(clipped(is_known), effects, adaptation=SHORTER):
        assert (recorded[:, 4:] == encode(np.array([expected]))).all()
    exposed = recorded_images(clipped(), (AUTO_EXPOSURE,), adaptation=SHORTER)[0]
    assert (exposed[:, :4] == 71).all()  # half the light of 100


def test_a_renderer_keeps_the_light_that_its_image_clips() -> None:
    """A sky with a few spots that are twenty times as bright as the rest."""
    sky = np.ones((16, 32, 3), np.float32)
    sky[6:10, ::8] = (20.0, 20.0, 1.0)
    scene = plate((0, 0, 0), (0.1, 0, 0), (0, 0, 0.1), Material("gray", np.full(3, 0.2)))
    camera = Camera(Intrinsics.from_fov(64, 48, 90.0), POSE)
    renderer = RaycastRenderer(scene, Environment(sky, 20.0))
    image, _, highlights = renderer.photograph(CameraTrack.still(camera), samples=1)
    assert highlights is not None
    white = (image == 255).any(axis=2)
    assert 0.01 < white.mean() < 0.9
    assert np.array_equal(highlights.pixels, np.flatnonzero(white))
    assert np.array_equal(encode(highlights.light), image[white])
    assert highlights.light[:, 0].max() > 2.0 > 1.0 > highlights.light[:, 2].max()
