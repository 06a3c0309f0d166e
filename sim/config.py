"""The settings of a recording: what to record, with which camera, and how."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from digs_warp.checks import DigsError
from digs_warp.settings import ANGLE, FRAMES, NO_FLAG, SEED, SIDE, Range, Settings
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.record.labels.names import labels_named
from digs_warp.sim.scene.appearance import LookSettings
from digs_warp.sim.scene.environment import Ground
from digs_warp.sim.scene.mesh.placement import Unit

# Frames of a recording for which nothing says otherwise.
USUAL_FRAMES = 60

Tier = Literal["truth", "law", "guided", "matcher"]


@dataclass(frozen=True, kw_only=True)
class SimulateConfig(Settings):
    """What to record and how. The same settings give the same bytes."""

    mesh: Path | None = None
    """The object: GLB, glTF, OBJ, PLY or STL. Default: the built-in object."""

    scene: tuple[Path, ...] = ()
    """Several objects instead of one: mesh files, placed at random beside each other, at rest on the ground.
    One that is named twice is there twice."""

    environment: Path | None = None
    """The surround and its light: an equirectangular HDR, EXR, PNG or JPG. Default: a built-in room."""

    ground: Ground = "auto"
    """What the object stands on. 'floor': the lower part of the environment, projected from the height of a
    photographer; the built-in room has its own. 'table': a table on that floor. 'none': the object hangs in
    the middle of a sphere. auto: a table for objects up to half a metre, a floor for larger ones and in the
    built-in room."""

    object_turn: Annotated[float, ANGLE, NO_FLAG] = 0.0
    """Turn the objects about the vertical axis [degree], counterclockwise from above."""

    frames: Annotated[int | None, FRAMES] = None
    """Number of stereo frames, evenly spaced in time over the walk. Default: 60, or fps times duration."""

    profile: str | None = None
    """The camera: d435, d455, gemini-335, oak-d, oak4-d, zed2-2k, zed2-1080, zed2-720, zed2-vga,
    bare-matcher, or a YAML file. Default: d435, a RealSense at 640 x 360, its depth like that of one
    (docs/research/devices.md). It has no right color image: stereo labels and right images need a camera
    whose left eye takes the images, such as zed2-720."""

    width: Annotated[int | None, SIDE] = None
    """Image width [px]. Default: that of the profile; 640 without one."""

    height: Annotated[int | None, SIDE] = None
    """Image height [px]. Default: from the width and the camera's aspect ratio."""

    samples_per_pixel: Annotated[int, Range(1, 4096)] = 4
    """Rays per pixel; more give smoother edges and take longer."""

    tier: Tier = "guided"
    """Depth sensor. truth: perfect; law: noise, steps and range of stereo depth; guided: matches the stereo
    images near the truth, with errors where a camera has them; matcher: over the full range, ten times as
    slowly."""

    effects: str = "auto"
    """Effects of the sensor: auto (what the scene calls for), all, none, or names separated by commas
    ('digs-warp plan' lists them). For the tiers 'guided' and 'matcher'."""

    strength: Annotated[float, Range(0, 100), arg(name="error-strength")] = 1.0
    """Factor on the errors of the sensor; 0: none, 2: twice those of the real sensor. Limits (the range, the
    band that only one eye sees) do not change."""

    labels: str = "none"
    """What else to write for training: none, all, or names separated by commas. 'right': true depth and mask
    of the right eye. 'disparity': true disparity of both eyes, and what the other eye does not see. 'flow':
    optical flow and change of disparity to the next frame, and what that does not show. 'normals'.
    'instances': the number of the object at each pixel."""

    renderer: Annotated[Literal["raycast", "gl"], NO_FLAG] = "raycast"
    """'gl' takes depth, normals and object numbers from OpenGL: a cross-check, which needs its driver."""

    object_size: Annotated[float | None, Range(0.001, 100)] = None
    """Scale the object: its longest side [m]. Default: the size that the file gives it. With --scene: the
    longest side of the longest object; the others keep their proportion to it."""

    unit: Annotated[Unit, arg(name="mesh-unit")] = "auto"
    """Unit of the mesh file. auto: metres for GLB and glTF; the other formats have none, so it is guessed
    from the size and printed."""

    up: Annotated[Literal["auto", "y", "z"], arg(name="mesh-up")] = "auto"
    """Which axis of the mesh file points up. auto: that of the format, y for GLB, glTF and OBJ, z for PLY and
    STL; an object that would fall is turned so that it rests. An axis that is named here keeps its pose."""

    seed: Annotated[int, SEED] = 0
    """Seed of the hand, pixel sampling and everything random in the sensor."""

    look: LookSettings = field(default_factory=LookSettings)

    walk: WalkSettings = field(default_factory=WalkSettings)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mesh is not None and self.scene:
            raise DigsError(
                "--mesh and --scene contradict each other; name the mesh in --scene, too"
            )
        self._check_beats()
        if self.object_size is not None and self.unit != "auto":
            raise DigsError(
                f"--object-size {self.object_size:g} and --mesh-unit {self.unit} both set the size of the "
                "object; give one of them"
            )
        labels = labels_named(self.labels)
        if self.walk.path == "turntable" and (self.scene or {"flow", "instances"} & set(labels)):
            raise DigsError(
                "--camera-path turntable: one object turns, and neither flow nor places of objects are "
                "written; leave out --scene, and of --labels flow and instances"
            )
        if self.effects != "auto" and not self.plans_effects:
            raise DigsError(
                f"--effects {self.effects}: has no meaning with --tier {self.tier}; choose --tier guided or "
                "matcher, or leave it out"
            )

    def _check_beats(self) -> None:
        fps, duration = self.walk.fps, self.walk.duration
        if fps is None or duration is None:
            return
        if self.frames is not None:
            raise DigsError(
                f"--frames {self.frames}, --fps {fps:g} and --duration {duration:g}: two of them give the "
                "third; leave one out"
            )
        try:
            FRAMES.check("--frames", self.frame_count)
        except DigsError as error:
            raise DigsError(f"--fps {fps:g} for --duration {duration:g}: {error}") from None

    @property
    def frame_count(self) -> int:
        """Number of frames of the recording."""
        if self.frames is not None:
            return self.frames
        if self.walk.fps is None or self.walk.duration is None:
            return USUAL_FRAMES
        return round(self.walk.fps * self.walk.duration)

    @property
    def input_files(self) -> list[Path | None]:
        """The files that the recording reads; None for what is built in."""
        return [self.mesh, self.environment, *self.scene]

    @property
    def plans_effects(self) -> bool:
        """Whether the tier asks the scene which effects it calls for."""
        return self.tier in ("guided", "matcher")
