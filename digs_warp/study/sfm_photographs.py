"""Photographs of a walk around the built-in object, for the benchmarks of structure from motion.

Left images only, with the color errors of the sensor or of an ideal camera. The folder is a capture without
depth. A complete one is reused, and an interrupted one is continued.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from digs_warp.data.capture import read_capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.layers import Layer
from digs_warp.record.progress import progress
from digs_warp.sim.camera.shutter import ShutteredEye
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import SensorPlan, make_plan
from digs_warp.sim.record.session import Session, prepare_session
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.color.protocol import EyeImages
from digs_warp.sim.sensor.planner import override
from digs_warp.sim.sensor.tiers import effect_rng

SAMPLES_PER_PIXEL = 2
LAYERS = (Layer.IMAGE,)


@dataclass(frozen=True)
class Photographs:
    """Number and size [px] of photographs over three orbits at about 0.9 m."""

    count: int
    width: int
    height: int

    def __str__(self) -> str:
        return f"{self.count} of {self.width}x{self.height}"

    def session(self) -> Session:
        """Return the walk, ready to be photographed."""
        config = SimulateConfig(frames=self.count, width=self.width, height=self.height)
        return prepare_session(config, load_inputs(config))


IDEAL = SensorPlan()


def planned_sensor(session: Session) -> SensorPlan:
    """Return the planned effects on the images; none on depth, which is not recorded."""
    plan = make_plan(session)
    return replace(plan, depth=())


def only(plan: SensorPlan, effects: frozenset[str]) -> SensorPlan:
    """Return the plan with these effects on and all others off."""
    return replace(plan, color=override(plan.color, effects), depth=())


def photograph_walk(session: Session, folder: Path, plan: SensorPlan = IDEAL) -> list[Frame]:
    """Return the photographs in ``folder``, taking them first if necessary; frames have the true cameras."""
    if not (folder / INDEX_NAME).is_file():
        _photograph(session, folder, plan)
    return list(read_capture(folder).frames)


def _photograph(session: Session, folder: Path, plan: SensorPlan) -> None:
    writer = CaptureWriter(folder, session.rig.intrinsics)
    moments = session.moments
    with progress(len(moments), "Photographing", "image") as bar:
        for number, moment in enumerate(moments):
            if not writer.has_frame(number, LAYERS):
                writer.write_frame(number, FrameImages(_left_image(session, plan, number)))
            writer.add_pose(number, session.walk.pose(moment), moment)
            bar.update()
    writer.finish()


def _left_image(session: Session, plan: SensorPlan, number: int) -> np.ndarray:
    """Return what the left eye records, sRGB, (height, width, 3), uint8."""
    moment, k = session.moments[number], session.rig.intrinsics
    adapted = plan.adapted(moment)
    eye = ShutteredEye(
        session.renderer,
        plan.shutter(session.rig, adapted=adapted),
        k,
        lambda after: session.walk.pose(moment + after),
    )
    image, _ = eye.image(SAMPLES_PER_PIXEL, np.random.SeedSequence(number))
    if not plan.pixel_effects:
        return image
    linear = decode(image)
    eyes = EyeImages(k, linear, linear, adapted)
    for effect in plan.pixel_effects:
        rng = effect_rng(session.config.seed, number, effect.name)
        eyes = effect.apply(eyes, session.rig, rng)
    return encode(eyes.left)
