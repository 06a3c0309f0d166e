"""Stereo cameras as data: every figure has its origin, so that readers know what to trust.

A profile is a base profile plus its own figures. "Class" in the titles of the built-in ones means
that they are bounded by published figures, not fitted to one device. docs/sensor.md shows a custom one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

from digs_warp.checks import DigsError
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.fields import shown
from digs_warp.record.files import read_yaml
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.words import did_you_mean

Origin = Literal["measured", "vendor", "tuned"]

# Figures in addition to those of the rig: the native image size and its focal length [px].
IMAGE_FIGURES = ("width", "height", "focal")
RIG_FIGURES = tuple(field.name for field in fields(StereoRig) if field.name != "intrinsics")


@dataclass(frozen=True)
class Figure:
    """One number of a profile.

    Attributes:
        value: in the unit of the rig's field of that name.
        origin: measured (on a device or a real pair), vendor (data sheet), tuned (chosen to fit).
        note: its source.
    """

    value: float
    origin: Origin
    note: str = ""


@dataclass(frozen=True)
class Profile:
    """A camera model.

    Attributes:
        name: as --profile takes it.
        title: for reports.
        figures: every figure of IMAGE_FIGURES and RIG_FIGURES by name.
    """

    name: str
    title: str
    figures: Mapping[str, Figure]

    def __post_init__(self) -> None:
        unknown = sorted(set(self.figures) - set(IMAGE_FIGURES) - set(RIG_FIGURES))
        missing = [n for n in IMAGE_FIGURES + RIG_FIGURES if n not in self.figures]
        if unknown or missing:
            raise DigsError(
                f"profile '{self.name}': unknown figures {unknown}, missing figures {missing}; "
                f"expected {', '.join(IMAGE_FIGURES + RIG_FIGURES)}"
            )

    def rig(self, width: int | None = None, height: int | None = None) -> StereoRig:
        """Return the rig, by default at the native image size [px]; the angle across is always the same."""
        native_width = int(self.figures["width"].value)
        width = width or native_width
        height = height or round(width * self.figures["height"].value / native_width)
        focal = self.figures["focal"].value * width / native_width
        intrinsics = Intrinsics(width, height, focal, focal, width / 2, height / 2)
        values: dict[str, Any] = {name: self.figures[name].value for name in RIG_FIGURES}
        values |= {name: int(values[name]) for name in ("window", "unit")}
        return StereoRig(intrinsics=intrinsics, **values)


MODELS = Path(__file__).parent / "models"
PROFILES = (
    *("zed2-2k", "zed2-1080", "zed2-720", "zed2-vga"),
    *("d435", "d455", "gemini-335", "oak-d", "oak4-d", "bare-matcher"),
)
"""The built-in profiles, files of their own beside this one."""

# The camera where none is named, and its image: a mode of the D435 with a quarter of the pixels of HD720, for
# speed.
DEFAULT_PROFILE, DEFAULT_SIZE = "d435", (640, 360)

# The base of a profile that names none: without a device's own steps. And what the first of all names.
DEFAULT_BASE, NOTHING = "zed2-720", "nothing"


def load_profile(source: str | Path) -> Profile:
    """Return a built-in profile by name, or read a custom one from a YAML file.

    Raises:
        DigsError: unknown name, missing file, or a file that does not describe a profile.
    """
    if str(source) in PROFILES:
        return _built_in(str(source))
    if Path(source).suffix.lower() not in (".yaml", ".yml"):
        raise DigsError(
            f"profile '{source}': not known{did_you_mean(str(source), PROFILES)}, or a .yaml file"
        )
    return _read_profile(Path(source))


@cache
def _built_in(name: str) -> Profile:
    return _read_profile(MODELS / f"{name}.yaml")


def _read_profile(path: Path) -> Profile:
    content = read_yaml(path, "profile")
    if not isinstance(content.get("figures"), dict):
        raise DigsError(f"profile '{path}': expected a mapping with 'figures', see docs/sensor.md")
    base, inherited = content.get("base", DEFAULT_BASE), {}
    if isinstance(base, str) and base in PROFILES:
        inherited = _built_in(base).figures
    elif base != NOTHING:
        raise DigsError(
            f"profile '{path}': base {shown(base)}, expected one of {', '.join(PROFILES)}"
        )
    own = {name: _read_figure(path, name, entry) for name, entry in content["figures"].items()}
    return Profile(path.stem, str(content.get("title", path.stem)), {**inherited, **own})


def _read_figure(path: Path, name: str, entry: object) -> Figure:
    place = f"profile '{path}': figure '{name}'"
    if not isinstance(entry, dict) or not isinstance(entry.get("value"), int | float):
        raise DigsError(f"{place}: found {shown(entry)}, expected {{value: number, origin: ...}}")
    if entry.get("origin") not in get_args(Origin):
        raise DigsError(
            f"{place}: origin {entry.get('origin')!r}, expected one of {', '.join(get_args(Origin))}"
        )
    return Figure(float(entry["value"]), entry["origin"], str(entry.get("note", "")))
