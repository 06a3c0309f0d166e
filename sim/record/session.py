"""Everything that is prepared before the first frame: scene, light, camera and its path."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.sim.camera.profiles import Profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.camera.shutter import Shutter, ShutteredEye
from digs_warp.sim.camera.walk.walk import Subject, Walk
from digs_warp.sim.camera.working_range import camera_distance
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import Inputs
from digs_warp.sim.scene.environment import Environment, Ground, set_up
from digs_warp.sim.scene.scene import Scene
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.frame import FrameTruth, Motion
from digs_warp.sim.sensor.infrared.pair import infrared_image, stands_out, with_dots
from digs_warp.sim.sensor.infrared.registration import ColorView

if TYPE_CHECKING:
    from digs_warp.sim.render.raycast import RaycastRenderer

# Width of a look at the scene [px]: a thousandth of a dozen looks is sixty pixels.
LOOK_WIDTH = 96

# Identify the eyes' pixel sampling in the seeds, apart from the ids of the sensor's effects.
LEFT_EYE, RIGHT_EYE, COLOR_CAMERA = 101, 102, 103

UNTURNED = np.eye(3)


@dataclass(frozen=True, eq=False)
class ObjectPixels:
    """Where an image shows the objects.

    Attributes:
        mask: share of each pixel that they cover, 0 to 255, (height, width), uint8.
        object_ids: number of the object at the pixel center, (height, width), int32; 0: none.
    """

    mask: np.ndarray
    object_ids: np.ndarray


@dataclass(frozen=True, eq=False)
class Session:
    """A scene, and a camera that is about to be carried around it.

    Attributes:
        config: what to record.
        scene: the objects.
        environment: the surround, large enough for the walk.
        profile: the camera model.
        rig: the camera at the image size in use.
        walk: where the camera is at any time.
        renderer: what it sees.
        ground: what the objects stand on; never "auto".
    """

    config: SimulateConfig
    scene: Scene
    environment: Environment
    profile: Profile
    rig: StereoRig
    walk: Walk
    renderer: "RaycastRenderer"
    ground: Ground = "none"

    @cached_property
    def moments(self) -> tuple[float, ...]:
        """Times of the frames [s]."""
        count, fps = self.config.frame_count, self.config.walk.fps
        period = 1.0 / fps if fps is not None else self.walk.end / count
        return tuple((period * np.arange(count)).tolist())

    def moment(self, number: int) -> float:
        """Return the time [s] of a frame."""
        return self.moments[number]

    def small(self) -> "Session":
        """Return the same walk seen in few pixels with a ray each, for the plan."""
        k = self.rig.intrinsics
        width = min(LOOK_WIDTH, k.width)
        looking = k.resized(width, max(1, round(width * k.height / k.width)))
        config = replace(self.config, samples_per_pixel=1)
        return replace(self, config=config, rig=replace(self.rig, intrinsics=looking))

    def truth(
        self,
        number: int,
        shutter: Shutter,
        drift: Drift = NO_DRIFT,
        projects: bool = True,
        both_eyes: bool = True,
    ) -> tuple[FrameTruth, ObjectPixels]:
        """Render the two eyes of a frame; frames do not depend on each other.

        Args:
            number: of the frame, 0 to ``config.frame_count`` - 1.
            shutter: through which both eyes look.
            drift: of the right eye.
            projects: whether the projector is on, if the camera has one.
            both_eyes: whether to render the right image; if not, the left one is used for both.

        Returns:
            The truth of the frame, and where the left eye sees the objects.
        """
        moment, samples, rig = self.moment(number), self.config.samples_per_pixel, self.rig
        left_shift = -rig.color_offset
        left, right = self.eyes(number, shutter, drift)
        image, mask, highlights = left.photograph(samples, self._eye_seed(number, LEFT_EYE))
        right_image, right_mask, right_highlights = image, None, highlights
        if both_eyes:
            seed = self._eye_seed(number, RIGHT_EYE)
            right_image, right_mask, right_highlights = right.photograph(samples, seed)
        seen = left.geometry()
        dots_show = None
        if rig.has_color_camera:
            image, right_image = infrared_image(image), infrared_image(right_image)
            highlights = right_highlights = None  # of the colors
        gain = np.float32(rig.projector_power * self.renderer.exposure)
        if gain > 0 and projects:
            place = left_shift + rig.projector_offset
            projector_at = partial(self._pose, moment, place, UNTURNED)
            dots = left.project_dots(projector_at)
            beside = right.project_dots(projector_at) if both_eyes else dots
            dots_show = stands_out(image, gain * dots.peak, rig)
            image = with_dots(image, gain * dots.light)
            right_image = with_dots(right_image, gain * beside.light)
        velocity, angular_velocity = self.walk.motion(moment)
        truth = FrameTruth(
            number=number,
            camera=Camera(rig.intrinsics, self._pose(moment, left_shift, UNTURNED, 0.0)),
            rig=rig,
            image=image,
            right=right_image,
            right_mask=right_mask,
            depth=seen.depth,
            normals_world=seen.normals_world,
            material_ids=seen.material_ids,
            materials=self.scene.materials,
            motion=Motion(_triple(velocity), _triple(angular_velocity)),
            rays=left.rays(rig.baseline),
            drift=drift,
            dots_show=dots_show,
            highlights=highlights,
            right_highlights=right_highlights,
        )
        return truth, ObjectPixels(mask, seen.object_ids)

    def color_view(self, number: int, shutter: Shutter) -> ColorView:
        """Render what the color camera of a rig with an infrared pair sees; see `truth`."""
        eye, pose = self.image_eye(number, shutter), self.walk.pose(self.moment(number))
        samples, seed = self.config.samples_per_pixel, self._eye_seed(number, COLOR_CAMERA)
        image, mask, highlights = eye.photograph(samples, seed)
        camera = Camera(eye.intrinsics, pose)
        return ColorView(camera, image, mask, *eye.geometry(), highlights)

    def eyes(
        self, number: int, shutter: Shutter, drift: Drift = NO_DRIFT
    ) -> tuple[ShutteredEye, ShutteredEye]:
        """Return the left and the right eye, from which depth is measured; see `truth`."""
        rig, place = self.rig, -self.rig.color_offset
        turn, right_k = drift.believed_from_turned, drift.right_intrinsics(rig.intrinsics)
        left = self._eye(number, shutter, rig.intrinsics, place)
        return left, self._eye(number, shutter, right_k, place + rig.baseline, turn)

    def image_eye(self, number: int, shutter: Shutter) -> ShutteredEye:
        """Return the camera that takes the images: the left eye, or the one beside an infrared pair."""
        return self._eye(number, shutter, self.rig.image_intrinsics, 0.0)

    def renderer_at(self, number: int) -> "RaycastRenderer":
        """Return what shows the scene as it is in a frame: on a turntable the objects have turned."""
        if self.config.walk.path != "turntable":
            return self.renderer
        return _turned_renderer(self, number)

    def _eye(
        self,
        number: int,
        shutter: Shutter,
        intrinsics: Intrinsics,
        shift: float,
        turn: np.ndarray = UNTURNED,
    ) -> ShutteredEye:
        """Return the eye ``shift`` metres to the right of the camera that takes the images."""
        pose_at = partial(self._pose, self.moment(number), shift, turn)
        return ShutteredEye(self.renderer_at(number), shutter, intrinsics, pose_at)

    def _pose(self, moment: float, shift: float, turn: np.ndarray, after: float) -> np.ndarray:
        """Return the pose of an eye ``shift`` metres to the right, ``after`` seconds after a moment.

        ``turn``, (3, 3), is the rotation from the axes of the eye to those of the left one.
        """
        world_from_cam = self.walk.pose(moment + after)
        world_from_cam[:3, 3] += shift * world_from_cam[:3, 0]
        world_from_cam[:3, :3] = world_from_cam[:3, :3] @ turn
        return world_from_cam

    def _eye_seed(self, number: int, eye: int) -> np.random.SeedSequence:
        return np.random.SeedSequence([self.config.seed, number, eye])


def prepare_session(config: SimulateConfig, inputs: Inputs) -> Session:
    """Place the camera where it sees the object, the object on its ground, and the surround far enough."""
    walk = _walk(config, inputs)
    scene, surround, ground = set_up(inputs.scene, inputs.environment, config.ground, walk.farthest)
    renderer = _make_renderer(config, scene, surround)
    return Session(config, scene, surround, inputs.profile, inputs.rig, walk, renderer, ground)


def _walk(config: SimulateConfig, inputs: Inputs) -> Walk:
    scene, rig = inputs.scene, inputs.rig
    ground = None if config.ground == "none" else float(scene.object_vertices[:, 2].min())
    subject = Subject(scene.object_radius, rig.image_intrinsics, ground, rig.image_baseline)
    settings = config.walk.for_frames(config.frame_count)
    return Walk.around(subject, camera_distance(scene, rig, settings), settings, config.seed)


def _make_renderer(
    config: SimulateConfig, scene: Scene, environment: Environment
) -> "RaycastRenderer":
    if config.renderer == "gl":
        from digs_warp.sim.render.gl import GlRenderer

        return GlRenderer(scene, environment)
    from digs_warp.sim.render.raycast import RaycastRenderer

    return RaycastRenderer(scene, environment)


@lru_cache(maxsize=16)  # frames are made side by side, and several eyes look at each
def _turned_renderer(session: Session, number: int) -> "RaycastRenderer":
    turn = 2 * np.pi * number / session.config.frame_count
    return _make_renderer(session.config, session.scene.turned(turn), session.environment)


def _triple(vector: np.ndarray) -> Any:
    return tuple(float(value) for value in vector)
