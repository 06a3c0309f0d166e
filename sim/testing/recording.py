"""A recording of the user's own, and the camera that took it, as a source of captures with more noise."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.fields import is_number
from digs_warp.settings import SEED, Settings
from digs_warp.sim.camera.profiles import RIG_FIGURES, load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.record.inputs import DEFAULT_PROFILE
from digs_warp.sim.record.sensor_plan import ALL_EFFECT_NAMES
from digs_warp.sim.sensor.on_recordings import EFFECTS_ON_RECORDINGS
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
    """

    capture: Path
    profile: str | None = None
    effects: str = "auto"
    seed: Annotated[int, SEED] = 0


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
