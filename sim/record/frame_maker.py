"""Makes the images of one frame: the truth, the sensor's measurement, and the content of the files."""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.data.capture_writer import FrameImages
from digs_warp.data.images import to_uint8
from digs_warp.data.layers import BASIC_LAYERS, INFRARED_LAYERS, Layer
from digs_warp.data.rig import CameraMotion, Exposure
from digs_warp.record.run_log import timed
from digs_warp.sim.camera.shutter import Shutter, ShutteredEye
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs, rig_of
from digs_warp.sim.record.labels.frame import LabeledFrame
from digs_warp.sim.record.labels.names import label_layers, labels_named
from digs_warp.sim.record.sensor_plan import SensorPlan, check_effects, make_plan
from digs_warp.sim.record.session import ObjectPixels, Session, prepare_session
from digs_warp.sim.sensor.color.adaptation import Adaptation
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.infrared.registration import ColorView, Registered, registered
from digs_warp.sim.sensor.tiers import depth_of, sense

# Added to the seed for the noise of a color camera beside an infrared pair.
COLOR_SEED = 2**32


def layers_of(config: SimulateConfig, number: int) -> tuple[Layer, ...]:
    """Return the layers that a recording writes for a frame."""
    basic = INFRARED_LAYERS if rig_of(config).has_color_camera else BASIC_LAYERS
    sensor = (Layer.CAUSE, Layer.CONFIDENCE) if config.plans_effects else ()
    labels = label_layers(labels_of(config), is_last=number == config.frame_count - 1)
    return (*basic, *sensor, *labels)


def labels_of(config: SimulateConfig) -> tuple[str, ...]:
    """Return the labels of a recording: those asked for, and the numbers of several objects."""
    of_several = ("instances",) if config.scene else ()
    return tuple(dict.fromkeys((*labels_named(config.labels), *of_several)))


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """A frame before the sensor.

    Attributes:
        truth: of the eyes that measure depth.
        objects: where the recorded image shows the objects.
        color: what the color camera beside an infrared pair sees; None: the left eye takes the images.
    """

    truth: FrameTruth
    objects: ObjectPixels
    color: ColorView | None = None


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
        """Return the truth of a frame, and of those before it that the device remembers."""
        truth, objects = self._truth(number)
        if not truth.rig.has_color_camera:
            return RenderedFrame(truth, objects)
        color = self.session.color_view(number, self._shutter(number))
        return RenderedFrame(truth, ObjectPixels(color.mask, color.object_ids), color)

    def _truth(self, number: int) -> tuple[FrameTruth, ObjectPixels]:
        config, session = self.session.config, self.session
        drift = self.plan.drift(session.rig, config.seed, config.strength)
        return session.truth(number, self._shutter(number), drift, self.plan.projects)

    def _shutter(self, number: int) -> Shutter:
        config, rig = self.session.config, self.session.rig
        return self.plan.shutter(rig, config.strength, self._adapted(number))

    def exposure(self, number: int) -> Exposure:
        """Return how the camera moves in a frame, and how long its shutter is open."""
        motion = CameraMotion.of(*self.session.walk.motion(self.session.moment(number)))
        if not self.session.config.plans_effects:
            return Exposure(motion)
        return Exposure(motion, self._shutter(number).exposure_time)

    def recorded_eye(self, number: int) -> ShutteredEye:
        """Return the camera that takes the images of a frame."""
        return self.session.image_eye(number, self._shutter(number))

    def finish(self, frame: RenderedFrame, seconds: dict[str, float]) -> FrameImages:
        """Return the content of the files; safe to call in several threads, as `render` is.

        Args:
            frame: what the eyes see.
            seconds: takes the time of each stage.
        """
        recorded = (
            self._measured(frame, seconds)
            if frame.color is None
            else self._registered(frame, frame.color, seconds)
        )
        with timed(seconds, "label"):
            labels = self._labels(frame)
        return recorded.with_layers(labels)

    def _labels(self, frame: RenderedFrame) -> dict[Layer, np.ndarray]:
        """Return the labels that the settings ask for."""
        number, session = frame.truth.number, self.session
        is_last = number == session.config.frame_count - 1
        labeled = LabeledFrame(
            session=session,
            truth=frame.truth,
            color=frame.color,
            objects=frame.objects,
            shutter=self._shutter(number),
            next_shutter=None if is_last else self._shutter(number + 1),
        )
        return labeled.images(labels_of(session.config))

    def _measured(self, frame: RenderedFrame, seconds: dict[str, float]) -> FrameImages:
        """Return the content of the files of a stereo camera, without labels."""
        config, truth = self.session.config, frame.truth
        with timed(seconds, "color"):
            image, right = self._recorded(truth)
        with timed(seconds, "sense"):
            sensed = self._sensed(truth, (image, right))
            depth = depth_of(sensed, truth)
        tells = config.plans_effects
        return FrameImages(
            image=image,
            depth=depth,
            mask=frame.objects.mask,
            right=right,
            depth_true=truth.depth,
            cause=sensed.cause if tells else None,
            confidence=to_uint8(sensed.confidence) if tells else None,
        )

    def _registered(
        self, frame: RenderedFrame, view: ColorView, seconds: dict[str, float]
    ) -> FrameImages:
        """Return the same of a color camera beside an infrared pair."""
        config, truth = self.session.config, frame.truth
        tells = config.plans_effects
        with timed(seconds, "color"):
            image = self._recorded_color(truth, view)
            left, right = self._recorded(truth)
        with timed(seconds, "sense"):
            if tells and config.strength > 0:
                measured = registered(self._sensed(truth, (left, right)), truth, view)
            else:  # exact, or a law on exact depth: there is nothing to register
                measured = Registered.of(self._sensed(view.as_truth(truth)), view.as_truth(truth))
        return FrameImages(
            image=image,
            depth=measured.depth,
            mask=frame.objects.mask,
            depth_true=view.depth,
            cause=measured.cause if tells else None,
            confidence=to_uint8(measured.confidence) if tells else None,
            infrared_left=left,
            infrared_right=right,
        )

    def _recorded(self, truth: FrameTruth) -> tuple[np.ndarray, np.ndarray]:
        """Return the images of the two eyes after the effects on them; of an infrared pair, one channel."""
        config, adapted = self.session.config, self._adapted(truth.number)
        effects, is_infrared = self.plan.pixel_effects, truth.rig.has_color_camera
        return recorded_images(truth, effects, config.seed, config.strength, adapted, is_infrared)

    def _recorded_color(self, truth: FrameTruth, view: ColorView) -> np.ndarray:
        """Return the color camera's image after the effects on it; its noise is not that of the eyes."""
        config = self.session.config
        own = truth.rig
        rig = replace(
            own,
            intrinsics=own.image_intrinsics,
            image_noise=own.color_noise,
            lens_blur=own.color_blur,
        )
        seen = view.as_truth(truth)
        alone = replace(seen, right=view.image, right_highlights=view.highlights, rig=rig)
        seed = config.seed + COLOR_SEED
        effects, adapted = self.plan.pixel_effects, self._adapted(truth.number)
        return recorded_images(alone, effects, seed, config.strength, adapted)[0]

    def _adapted(self, number: int) -> Adaptation:
        return self.plan.adapted(self.session.moment(number))

    def _sensed(
        self, truth: FrameTruth, recorded: tuple[np.ndarray, np.ndarray] | None = None
    ) -> Sensed:
        config = self.session.config
        return sense(truth, config.tier, self.plan.depth, config.seed, config.strength, recorded)
