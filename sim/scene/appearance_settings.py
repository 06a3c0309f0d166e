"""Settings of how a scene looks, beside what is in it: the light, and the finish of the objects."""

from dataclasses import dataclass
from typing import Annotated, Literal

from digs_warp.settings import ANGLE, NO_FLAG, Range, Settings

# Color temperature [K] at which the light of an environment stays as it is.
NEUTRAL_TEMPERATURE = 6500.0

# Of black bodies whose blue is not negative in sRGB [K].
TEMPERATURE = Range(2000, 25_000)


@dataclass(frozen=True, kw_only=True)
class LookSettings(Settings):
    """Changes of the light and of the objects' materials."""

    environment_turn: Annotated[float, ANGLE, NO_FLAG] = 0.0
    """Turn the environment about the vertical axis [degree], counterclockwise from above. The built-in room
    has corners: it turns to the nearest quarter."""

    light_level: Annotated[float, Range(-10, 10), NO_FLAG] = 0.0
    """Light of the environment against that which the exposure is set for [stops]; -1: half as bright. Images
    get darker, or the camera exposes longer where its automatic exposure is simulated. The dots of a
    projector keep their brightness."""

    light_temperature: Annotated[float, TEMPERATURE, NO_FLAG] = NEUTRAL_TEMPERATURE
    """Color of the light: that of a black body of this temperature [K]. 6500 leaves the environment as it is;
    less is warmer."""

    roughness_factor: Annotated[tuple[float, ...], Range(0, 100), NO_FLAG] = ()
    """Factor on the roughness of the objects: one for all of them, or one for each. At most they get fully
    rough; metal stays metal. Default: as in the mesh files."""

    tint: Annotated[tuple[float, ...], Range(0, 1), NO_FLAG] = ()
    """Tint of the objects: one for all of them, or one for each; 1 leaves them only the color of tint_hue.
    Default: none."""

    tint_hue: Annotated[tuple[float, ...], ANGLE, NO_FLAG] = ()
    """Hue of the tint [degree]: 0 is red, 120 green, 240 blue; one for all objects, or one for each. Default:
    red."""

    table_top: Annotated[Literal["oak", "random"], NO_FLAG] = "oak"
    """Top of the table of --ground table: oak laminate, or a random pattern in random colors and of random
    gloss, which follow from --seed."""


def of_object(values: tuple[float, ...], number: int, usual: float) -> float:
    """Return the value of an object, counted from 0, where one value counts for all, and none is ``usual``.

    Where there are fewer values than objects, they repeat.
    """
    return values[number % len(values)] if values else usual
