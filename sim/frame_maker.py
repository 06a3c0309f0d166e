"""Makes the images of one frame: the truth, the sensor's measurement, and the content of the files."""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.capture_writer import FrameImages
from digs_warp.data.images import to_uint8
from digs_warp.data.layers import BASIC_LAYERS, Layer
from digs_warp.record.run_log import timed
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import depth_of, sense
from digs_warp.sim.sensor_plan import SensorPlan, check_effects, make_plan
from digs_warp.sim.session import Session, load_inputs, prepare_session


def layers_of(config: SimulateConfig) -> tuple[Layer, ...]:
    """Return the layers that a recording writes for every frame."""
    sensor = (Layer.CAUSE, Layer.CONFIDENCE) if config.plans_effects else ()
    normals = (Layer.NORMALS,) if config.normals else ()
    return (*BASIC_LAYERS, *sensor, *normals)


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """A frame before the sensor: its truth and the mask of the object."""

    truth: FrameTruth
    mask: np.ndarray


@dataclass(frozen=True, eq=False)
class FrameMaker:
    """Renders frames and applies the sensor to them; frames do not depend on each other."""

    session: Session
    plan: SensorPlan

    @staticmethod
    def of(config: SimulateConfig) -> "FrameMaker":
        """Load what the settings name and choose the effects of the sensor.

        Raises:
            DigsError: bad input.
        """
        check_effects(config)
        session = prepare_session(config, load_inputs(config))
        return FrameMaker(session, make_plan(session))

    def render(self, number: int) -> RenderedFrame:
        """Return the truth of a frame."""
        config, rig = self.session.config, self.session.rig
        shutter = self.plan.shutter(rig, config.strength)
        drift = self.plan.drift(rig, config.seed, config.strength)
        return RenderedFrame(*self.session.truth(number, shutter, drift))

    def finish(self, frame: RenderedFrame, seconds: dict[str, float]) -> FrameImages:
        """Return the content of the files; safe to call during `render` in another thread.

        Args:
            frame: what the eyes see.
            seconds: takes the time of each stage.
        """
        config, truth = self.session.config, frame.truth
        with timed(seconds, "color"):
            effects = self.plan.pixel_effects
            image, right = recorded_images(truth, effects, config.seed, config.strength)
        with timed(seconds, "sense"):
            sensed = sense(
                truth, config.tier, self.plan.depth, config.seed, config.strength, (image, right)
            )
            depth = depth_of(sensed, truth)
        tells = config.plans_effects
        return FrameImages(
            image=image,
            depth=depth,
            mask=frame.mask,
            right=right,
            depth_true=truth.depth,
            cause=sensed.cause if tells else None,
            confidence=to_uint8(sensed.confidence) if tells else None,
            normals=truth.normals_world if config.normals else None,
        )
