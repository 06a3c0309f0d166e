"""Settings of a walk: where it goes, how steadily, and when the camera takes its frames."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from tyro.conf import arg

from digs_warp.checks import DigsError
from digs_warp.settings import FRAME_RATE, NO_FLAG, Range, Settings

PathName = Literal["orbits", "arc", "hover", "approach", "turntable"]

WALKING_SPEED = 0.2  # [m/s] mean speed of the person whose shake was measured

# Low enough to look under overhangs and high enough to see the top; 25 degrees apart, so that neighboring
# orbits share most of their view.
ALL_ROUND = (10.0, 35.0, 60.0)
FROM_ABOVE = (35.0,)

# Elevations of each path where none are named [degree].
USUAL_ELEVATIONS: dict[PathName, tuple[float, ...]] = {
    "orbits": ALL_ROUND,
    "arc": ALL_ROUND,
    "hover": FROM_ABOVE,
    "approach": FROM_ABOVE,
    "turntable": FROM_ABOVE,
}

# Time [s] for which a hand hovers where nothing says otherwise.
HOVERING = 10.0


@dataclass(frozen=True, kw_only=True)
class WalkSettings(Settings):
    """Where the camera is carried, how steadily, and when it takes its frames."""

    path: Annotated[PathName, arg(name="camera-path", aliases=("--path",))] = "orbits"
    """'orbits': once round the objects at each elevation. 'arc': to and fro in front of them, a third of the
    circle at each elevation. 'hover': a hand that holds the camera still, as well as it can. 'approach':
    toward them, from two and a half times the distance. 'turntable': the camera stands on a tripod, and the
    object turns once, counterclockwise, with a stop for each frame."""

    elevations: Annotated[tuple[float, ...], Range(-80, 80)] = ()
    """Heights of the camera above the horizon, seen from the objects [degree]. Default: 10 35 60; 35 for
    the others. Hover and turntable take the first."""

    distance: Annotated[float | None, Range(0.01, 1000), arg(name="camera-distance")] = None
    """Distance from the middle of the objects [m]; 'approach' ends there. Default: the objects just stay in
    the image, and nothing is too near for the depth camera."""

    distance_factor: Annotated[float, Range(0.1, 10), NO_FLAG] = 1.0
    """Factor on the default of --camera-distance, for objects of many sizes."""

    speed: Annotated[float, Range(0.001, 100), arg(name="camera-speed")] = WALKING_SPEED
    """Speed along the path [m/s]; hover has none. Three orbits around a mug take half a minute, around a
    chair five."""

    duration: Annotated[float | None, Range(0.01, 3 * 3600)] = None
    """How long the camera is carried [s]. Where the path is shorter, it goes back; where it is longer, the
    rest is left out. Default: to the end of the path; 10 s for hover; frames over fps with --fps."""

    fps: Annotated[float | None, FRAME_RATE] = None
    """Frames per second. With --duration it gives the number of frames, with --frames the duration. Default:
    the frames are spread evenly over the walk."""

    unsteadiness: Annotated[float, Range(0, 4), NO_FLAG] = 1.0
    """Factor on the slow wander of a hand: distance, height and pace that vary, and an aim that drifts. 0: a
    perfect path."""

    shake: Annotated[float, Range(0, 10), NO_FLAG] = 1.0
    """Factor on the shake of a hand, above half a hertz; 0: a gimbal."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.distance is not None and self.distance_factor != 1:
            raise DigsError(
                f"--camera-distance {self.distance:g} and distance_factor {self.distance_factor:g} "
                "contradict each other; give one of them"
            )

    def for_frames(self, frames: int) -> "WalkSettings":
        """Return the settings with the duration that a number of frames takes, if --fps is given.

        Of a turntable, the hand is a tripod.
        """
        steady = replace(self, unsteadiness=0.0, shake=0.0) if self.path == "turntable" else self
        if self.fps is None or self.duration is not None:
            return steady
        return replace(steady, duration=frames / self.fps)

    @property
    def chosen_elevations(self) -> tuple[float, ...]:
        """The elevations of the path [degree]."""
        return self.elevations or USUAL_ELEVATIONS[self.path]
