"""Frames that sensors measure over and over: of every sample mesh, half of them kept aside from tuning."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig, Tier
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import plan_for_facts
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.color.protocol import PixelEffect
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.facts import SceneFacts, measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.engine.case import STUDIED_CAMERA
from digs_warp.study.scenes import OBJECT_SIZE

FRAMES = 60  # of the walk
NUMBER = 17  # the one that is taken

BUILT_IN = "built-in"


@dataclass(frozen=True, eq=False)
class Scene:
    """A frame, and what sensors measure on it.

    Attributes:
        name: of the mesh.
        tuned: whether the constants of the default sensor were chosen on it, among others.
        truth: of the frame.
        mask: of the object, (height, width), bool.
        facts: what the planner measures on it.
        effects: on the images.
        fresh: returns the truth with nothing computed yet, so that a sensor pays for what it needs.
    """

    name: str
    tuned: bool
    truth: FrameTruth
    mask: np.ndarray
    facts: SceneFacts
    effects: Sequence[PixelEffect]
    fresh: Callable[[], FrameTruth]

    def images(self, draw: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Return the two images under one draw of the image noise."""
        return recorded_images(self.truth, self.effects, draw)

    def sense(self, tier: Tier, draw: int = 0) -> Sensed:
        """Return what a tier measures under one draw of the image noise.

        Without the effects on depth: the yardstick has neither calibration errors nor filters.
        """
        return sense(self.truth, tier, seed=draw, recorded=self.images(draw))


@dataclass(frozen=True)
class Place:
    """What a scene is made of.

    Attributes:
        mesh: file; None: the built-in object.
        environment: file; None: the built-in room.
        tuned: see `Scene`.
    """

    mesh: Path | None = None
    environment: Path | None = None
    tuned: bool = False

    def scene(self, width: int) -> Scene:
        """Render a frame, ``width`` pixels wide."""
        config = SimulateConfig(
            profile=STUDIED_CAMERA,
            mesh=self.mesh,
            environment=self.environment,
            object_size=None if self.mesh is None else OBJECT_SIZE,
            width=width,
            frames=FRAMES,
        )
        session = prepare_session(config, load_inputs(config))
        truth, objects = session.truth(NUMBER, Shutter())
        facts = measure_facts([truth], truth.rig)
        plan = plan_for_facts(facts, session.rig, config)
        name = self.mesh.stem if self.mesh else BUILT_IN

        def fresh() -> FrameTruth:
            rays = session.renderer.frame_rays(truth.camera, truth.rig.baseline)
            return replace(truth, rays=rays)

        mask = objects.mask > 127
        return Scene(name, self.tuned, truth, mask, facts, plan.pixel_effects, fresh)


def places(data: Path) -> list[Place]:
    """Return the sample meshes, each with one of the environments in turn; else the built-in object.

    Every other mesh, in the order of their names, is for tuning.

    Args:
        data: folder of the sample data.
    """
    environments = [None, *sorted(data.glob("envs/*/*.hdr"))]
    found = [
        Place(mesh, environments[number % len(environments)], tuned=number % 2 == 0)
        for number, mesh in enumerate(sorted(data.glob("meshes/*/*.glb")))
    ]
    return found or [Place()]
