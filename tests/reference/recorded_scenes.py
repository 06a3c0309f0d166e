"""Small frames with the images that a camera would record, for tests that compare sensors."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.camera.walk.paths import half_angles
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.config import SimulateConfig, Tier
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import plan_for_facts
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.color.protocol import PixelEffect
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.tiers import sense

WIDTH = 480
FRAMES, NUMBER = 60, 17  # of a walk; the one that is taken
MARGIN = 1.1  # around the object in the image


@dataclass(eq=False)
class RecordedScene:
    """A frame, the mask of its object, its effects on images, and what sensors measure on it, made once."""

    truth: FrameTruth
    mask: np.ndarray
    effects: tuple[PixelEffect, ...]

    @cache  # noqa: B019
    def images(self, draw: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Both images under one draw of the noise."""
        return recorded_images(self.truth, self.effects, draw)

    @cache  # noqa: B019
    def sense(self, tier: Tier, draw: int = 0) -> Sensed:
        """What a tier measures on these images, without effects on depth."""
        return sense(self.truth, tier, recorded=self.images(draw))


def record_scene(
    mesh: Path | None = None, environment: Path | None = None, drifts: bool = False
) -> RecordedScene:
    """Render a frame of a mesh of half a metre, or of the built-in object in its room.

    ``drifts``: with the calibration of a recording that differs from the factory's.
    """
    config = SimulateConfig(
        profile="bare-matcher",
        mesh=mesh,
        environment=environment,
        object_size=None if mesh is None else 0.5,
        width=WIDTH,
        frames=FRAMES,
        tier="guided",
        ground="none",  # what the figures of the tests were set for, as the distance
    )
    inputs = load_inputs(config)
    half_angle = half_angles(inputs.rig.image_intrinsics).min()
    distance = MARGIN * inputs.scene.object_radius / float(np.sin(half_angle))
    config = replace(config, walk=WalkSettings(distance=distance, unsteadiness=0.0))
    session = prepare_session(config, inputs)
    truth, objects = session.truth(NUMBER, Shutter())
    plan = plan_for_facts(measure_facts([truth], truth.rig), session.rig, config)
    if drifts:
        truth, objects = session.truth(NUMBER, Shutter(), plan.drift(session.rig, seed=3))
        assert truth.drift.moves_right_image
    return RecordedScene(truth, objects.mask > 127, plan.pixel_effects)
