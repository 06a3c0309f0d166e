"""The settings of a recording: what to record, with which camera, and how."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from digs_warp.bounds import check_flag
from digs_warp.checks import DigsError
from digs_warp.sim.mesh.placement import Unit
from digs_warp.sim.sensor.after.names import filters_named

Tier = Literal["truth", "law", "guided", "matcher"]


@dataclass(frozen=True, kw_only=True)
class SimulateConfig:
    """What to record and how. The same settings give the same bytes."""

    mesh: Path | None = None
    """The object: GLB, glTF, OBJ, PLY or STL. Default: the built-in object."""

    environment: Path | None = None
    """The surround and its light: an equirectangular HDR, EXR, PNG or JPG. Default: a built-in room."""

    frames: int = 60
    """Number of stereo frames, uniformly spaced in time over three orbits."""

    profile: str | None = None
    """The camera: zed2-2k, zed2-1080, zed2-720, zed2-vga, d435, oak-d, or a YAML file. Default: zed2-720 with
    a narrower field of view (60 degrees), so that the object fills the image."""

    width: int | None = None
    """Image width [px]. Default: that of the profile; 640 without one."""

    height: int | None = None
    """Image height [px]. Default: from the width and the camera's aspect ratio."""

    samples_per_pixel: int = 4
    """Rays per pixel; more give smoother edges and take longer."""

    tier: Tier = "guided"
    """Sensor: 'truth' is perfect; 'law' has the noise, steps and range of stereo depth; 'guided' matches the
    two recorded images near the truth, so that errors lie where a camera has them; 'matcher' matches them
    over the full range, ten times as slowly."""

    effects: str = "auto"
    """Effects of the sensor: auto (what the scene calls for), all, none, or names separated by commas
    ('digs-warp plan' lists them). For the tiers 'guided' and 'matcher'."""

    filters: str = "none"
    """What the device does after matching: none, or names separated by commas. 'spatial', 'temporal' (renders
    four frames for one) and 'hole-filling' (from the farthest neighbor; also 'hole-filling-left' and
    'hole-filling-nearest') are librealsense's; 'dense' stands for the neural depth modes of the ZED family:
    smooth, hardly any holes, blurred steps. For the tiers 'guided' and 'matcher'."""

    confidence_threshold: float = 0.0
    """Drop matches with less confidence before any filter, 0 (none) to 1. For the tiers 'guided' and
    'matcher'."""

    strength: float = 1.0
    """Factor on the errors of the sensor; 0: none, 2: twice those of the real sensor. Limits (the range, the
    band that only one eye sees) do not change."""

    normals: bool = False
    """Also write the true normals."""

    renderer: Literal["raycast", "gl"] = "raycast"
    """'raycast' needs no graphics driver; 'gl' uses OpenGL: a cross-check, without reflections."""

    object_size: float | None = None
    """Scale the object: its longest side [m]. Default: the size that the file gives it."""

    unit: Unit = "auto"
    """Unit of the mesh file. auto: metres for GLB and glTF; the other formats have none, so it is guessed
    from the size and printed."""

    up: Literal["auto", "y", "z"] = "auto"
    """Which axis of the mesh file points up. auto: that of the format, y for GLB, glTF and OBJ, z for PLY and
    STL, with a warning if the object then lies where it could stand."""

    seed: int = 0
    """Seed of hand shake, pixel sampling and everything random in the sensor."""

    def __post_init__(self) -> None:
        check_flag("--frames", self.frames)
        check_flag("--width", self.width)
        check_flag("--height", self.height)
        check_flag("--samples-per-pixel", self.samples_per_pixel)
        check_flag("--seed", self.seed)
        check_flag("--strength", self.strength)
        check_flag("--confidence-threshold", self.confidence_threshold)
        check_flag("--object-size", self.object_size)
        if self.object_size is not None and self.unit != "auto":
            raise DigsError(
                f"--object-size {self.object_size:g} and --unit {self.unit} both set the size of the object; "
                "give one of them"
            )
        filters_named(self.filters)
        for flag, value, idle in (
            ("--effects", self.effects, "auto"),
            ("--filters", self.filters, "none"),
            ("--confidence-threshold", self.confidence_threshold, 0),
        ):
            if value != idle and not self.plans_effects:
                raise DigsError(
                    f"{flag} {value}: has no meaning with --tier {self.tier}; choose --tier guided or "
                    "matcher, or leave it out"
                )

    @property
    def plans_effects(self) -> bool:
        """Whether the tier asks the scene which effects it calls for."""
        return self.tier in ("guided", "matcher")
