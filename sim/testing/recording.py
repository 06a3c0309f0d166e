"""A recording as a source of captures with more noise: its camera and its frames with noise added."""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.images import to_uint8
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.fields import is_number
from digs_warp.record.manifest import recorded_files
from digs_warp.record.progress import progress
from digs_warp.settings import FRAMES, SEED, Settings
from digs_warp.sim.camera.profiles import DEFAULT_PROFILE, RIG_FIGURES, load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.record.frame_maker import COLOR_SEED
from digs_warp.sim.record.sensor_plan import ALL_EFFECT_NAMES
from digs_warp.sim.sensor.on_recordings import EFFECTS_ON_RECORDINGS, worse_depth, worse_images
from digs_warp.sim.sensor.planner import wanted_effects


@dataclass(frozen=True, kw_only=True)
class RecordingConfig(Settings):
    """Which recording, and which errors are added to it.

    Attributes:
        capture: its folder.
        profile: the camera, as `SimulateConfig.profile` names it; None: what the capture tells, and for the
            rest the default camera of simulations.
        effects: "auto" (all that work on a recording), or names separated by commas.
        seed: of all random numbers, >= 0.
        frames: at most so many, evenly spread over the recording; None: all.
    """

    capture: Path
    profile: str | None = None
    effects: str = "auto"
    seed: Annotated[int, SEED] = 0
    frames: Annotated[int | None, FRAMES] = None


@dataclass(frozen=True, eq=False)
class OwnRecording:
    """A recording with depth, the camera that took it, and the effects that are wanted.

    Attributes:
        capture: the recording.
        figures: of the camera; its intrinsics are those of the first frame.
        effects: names of those that act.
        seed: of all random numbers.
    """

    capture: Capture
    figures: StereoRig
    effects: frozenset[str]
    seed: int = 0

    @staticmethod
    def of(config: RecordingConfig) -> "OwnRecording":
        """Read the index of the recording; no pixels yet.

        Raises:
            DigsError: no capture, no depth in it, an effect that does not exist or needs a scene, or nothing
                that tells the baseline.
        """
        effects = _effects(config.effects)
        capture = read_capture(config.capture)
        if not capture.has_depth:
            raise DigsError(
                f"{capture}: no frame has depth, expected depth that a camera measured; record it with "
                "depth, or leave 'capture' out to simulate"
            )
        if config.frames is not None:
            capture = replace(capture, frames=tuple(evenly(capture.frames, config.frames)))
        return OwnRecording(capture, _figures(capture, config.profile), effects, config.seed)

    def depth_rig(self, k: Intrinsics) -> StereoRig:
        """Return the eyes that measured depth, for a frame whose camera has the intrinsics ``k``."""
        rig = self.capture.rig
        if rig is None:  # only the profile knows a camera beside the eyes
            fx, fy = k.fx / self.figures.color_zoom, k.fy / self.figures.color_zoom
        elif rig.infrared is None:
            fx, fy = k.fx, k.fy
        else:
            fx, fy = rig.infrared.fl_x, rig.infrared.fl_y
        return replace(self.figures, intrinsics=replace(k, fx=fx, fy=fy))

    def image_rig(self, k: Intrinsics) -> StereoRig:
        """Return the camera that took the images of such a frame."""
        figures = self.figures
        noise = figures.color_noise if figures.has_color_camera else figures.image_noise
        return replace(figures, intrinsics=k, image_noise=noise)


def _effects(selection: str) -> frozenset[str]:
    """Return the names that act; raise a `DigsError` for those that cannot."""
    own = [name for name in EFFECTS_ON_RECORDINGS if name not in ALL_EFFECT_NAMES]
    wanted = wanted_effects(selection, (*ALL_EFFECT_NAMES, *own))
    if wanted is None or selection == "all":
        return frozenset(EFFECTS_ON_RECORDINGS)
    possible = ", ".join(EFFECTS_ON_RECORDINGS)
    if impossible := sorted(wanted - set(EFFECTS_ON_RECORDINGS)):
        raise DigsError(
            f"effects: '{impossible[0]}' needs a simulated scene, which a recording does not have; on "
            f"recordings work {possible}"
        )
    if not wanted:
        raise DigsError(
            f"effects {selection!r}: nothing would change the recording; name some of {possible}"
        )
    return wanted


def _figures(capture: Capture, profile: str | None) -> StereoRig:
    """Return the camera: what the capture tells; the rest from the profile."""
    told: dict[str, Any] = {}
    if profile is None:  # a simulated capture has all figures, except infinite ones
        sensor = capture.about.sensor or {}
        told = {name: sensor[name] for name in RIG_FIGURES if is_number(sensor.get(name))}
    if capture.rig is not None:
        told["baseline"] = capture.rig.baseline
    if profile is None and "baseline" not in told:
        raise DigsError(
            f"{capture}: tells nothing about the eyes that measured its depth, expected a profile of its "
            "camera: profile='d435' or another that 'digs-warp simulate --help' names, or a YAML file"
        )
    rig = load_profile(profile or DEFAULT_PROFILE).rig()
    return replace(rig, intrinsics=capture.frames[0].camera.intrinsics, **told)


# What a camera records. Labels of a simulated recording belong to the depth that it had before.
CARRIED = (
    Layer.IMAGE,
    Layer.RIGHT,
    Layer.INFRARED_LEFT,
    Layer.INFRARED_RIGHT,
    Layer.DEPTH,
    Layer.MASK,
    Layer.CONFIDENCE,
    Layer.INSTANCES,
)


def write_noisy(recording: OwnRecording, strength: float, folder: Path) -> Capture:
    """Write the recording with errors of a strength; its own depth becomes the true depth.

    Frames that a run which was cut off has written are kept.

    Args:
        recording: what is read.
        strength: factor on the errors, >= 0; 0: the recording as it is.
        folder: where to.

    Raises:
        DigsError: a file of the recording cannot be read.
    """
    capture = recording.capture
    writer = CaptureWriter(folder, capture.frames[0].camera.intrinsics, capture.rig)
    with recorded_files(folder, resume=True) as manifest:
        manifest.drop_missing()
        with progress(len(capture), "Adding noise", "frame") as bar:
            for number, frame in enumerate(capture.frames):
                _write(writer, number, frame, recording, strength)
                bar.update()
        effects = tuple(sorted(recording.effects)) if strength > 0 else ()
        about = replace(capture.about, effects=effects, cause_labels=None)
        return writer.finish(about, capture.load_points())


def content_of(capture: Capture) -> str:
    """Return a hash of all that `write_noisy` reads of a capture."""
    files = [frame.path(each) for frame in capture.frames for each in CARRIED if frame.has(each)]
    if isinstance(capture.points, Path):
        files.append(capture.points)
    digest = hashlib.sha256()
    for path in (capture.folder / INDEX_NAME, *files):
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _write(
    writer: CaptureWriter, number: int, frame: Frame, recording: OwnRecording, strength: float
) -> None:
    layers = [each for each in CARRIED if frame.has(each)]
    if frame.has(Layer.DEPTH):
        layers.append(Layer.DEPTH_TRUE)
    k = frame.camera.intrinsics
    own = None if k == writer.intrinsics else k
    if not writer.has_frame(number, layers):
        writer.write_frame(number, _noisy(frame, number, recording, strength), own)
    writer.add_pose(
        *(number, frame.camera.world_from_cam, frame.time, own),
        color_gain=frame.color_gain,
        objects=frame.objects,
        exposure=frame.exposure,
    )


def _noisy(frame: Frame, number: int, recording: OwnRecording, strength: float) -> FrameImages:
    """Return the pixels of a frame with errors of a strength."""
    image, right = _noisy_images(frame, number, recording, strength)
    infrared_left, infrared_right = _noisy_infrared(frame, number, recording, strength)
    recorded, depth = None, None
    confidence = frame.load_confidence() if frame.has(Layer.CONFIDENCE) else None
    if frame.has(Layer.DEPTH):
        recorded = frame.load_depth()
        rig = recording.depth_rig(frame.camera.intrinsics)
        depth = worse_depth(recorded, rig, recording.effects, recording.seed, number, strength)
        if confidence is not None:
            confidence[np.isnan(depth) & ~np.isnan(recorded)] = 0.0
    return FrameImages(
        image=image,
        right=right,
        infrared_left=infrared_left,
        infrared_right=infrared_right,
        depth=depth,
        depth_true=recorded,
        mask=frame.load_mask() if frame.has(Layer.MASK) else None,
        confidence=None if confidence is None else to_uint8(confidence),
        instances=frame.load_instances() if frame.has(Layer.INSTANCES) else None,
    )


def _noisy_images(
    frame: Frame, number: int, recording: OwnRecording, strength: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return left and right image; no right one where there is none."""
    left = frame.load_image()
    has_right = frame.has(Layer.RIGHT)
    right = frame.load_right_image() if has_right else left
    rig = recording.image_rig(frame.camera.intrinsics)
    # A color camera has other noise than the infrared pair beside it.
    seed = recording.seed + COLOR_SEED
    left, right = worse_images(left, right, rig, recording.effects, seed, number, strength)
    return left, right if has_right else None


def _noisy_infrared(
    frame: Frame, number: int, recording: OwnRecording, strength: float
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return the infrared pair; nothing where it is not recorded."""
    if not (frame.has(Layer.INFRARED_LEFT) and frame.has(Layer.INFRARED_RIGHT)):
        return None, None
    left, right = (eye[..., None] for eye in frame.load_infrared())
    rig = recording.depth_rig(frame.camera.intrinsics)
    seed = recording.seed
    left, right = worse_images(left, right, rig, recording.effects, seed, number, strength)
    return left[..., 0], right[..., 0]
