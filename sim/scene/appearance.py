"""How a scene looks beside what is in it: light and finish, set or drawn at random."""

import colorsys
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from digs_warp.settings import ANGLE, NO_FLAG, Range, Settings
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene

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


def of_object(values: tuple[float, ...], number: int, usual: float) -> float:
    """Return the value of an object, counted from 0, where one value counts for all, and none is ``usual``.

    Where there are fewer values than objects, they repeat.
    """
    return values[number % len(values)] if values else usual


FULL_TEXEL = 255


def refinished(scene: Scene, look: LookSettings) -> Scene:
    """Return the scene with the finish that the settings ask for; metal stays metal."""
    if not (look.roughness_factor or look.tint):
        return scene
    finished = (
        material if owner == FURNITURE else _of_object(material, owner - 1, look)
        for material, owner in zip(scene.materials, _owners(scene), strict=True)
    )
    return replace(scene, materials=tuple(finished))


def tint_color(strength: float, hue: float) -> np.ndarray:
    """Return the factors of a tint on linear red, green and blue, (3,), in 0..1.

    Args:
        strength: 0 (none) to 1 (nothing but the hue).
        hue: [degree]; 0 red, 120 green, 240 blue.
    """
    return 1 - strength * (1 - np.array(colorsys.hsv_to_rgb(hue / 360 % 1.0, 1.0, 1.0)))


def _owners(scene: Scene) -> list[int]:
    """Return the number of the object of each material: no two share one, each brings its own."""
    owners = np.full(len(scene.materials), FURNITURE, np.int64)
    owners[scene.face_materials] = scene.face_objects
    return owners.tolist()


def _of_object(material: Material, number: int, look: LookSettings) -> Material:
    """Return a material of an object, counted from 0."""
    color = tint_color(of_object(look.tint, number, 0.0), of_object(look.tint_hue, number, 0.0))
    return _finished(material, of_object(look.roughness_factor, number, 1.0), color)


def _finished(material: Material, factor: float, color: np.ndarray) -> Material:
    finish = material.finish_texture
    if finish is not None and factor != 1:
        roughness = np.minimum(np.rint(finish[..., 0] * factor), FULL_TEXEL)
        finish = np.stack([roughness.astype(np.uint8), finish[..., 1]], axis=-1)
    return replace(
        material,
        base_color=(material.base_color * color).astype(np.float32),
        roughness=min(material.roughness * factor, 1.0),
        finish_texture=finish,
    )


QUARTER = 90.0  # degrees

# Linear sRGB from CIE XYZ (IEC 61966-2-1).
SRGB_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709


def relit(environment: Environment, look: LookSettings, has_corners: bool) -> Environment:
    """Return the environment with the light that the settings ask for.

    Args:
        environment: as it was loaded.
        look: turn, level and color temperature.
        has_corners: whether it is a square room, which turns to the nearest quarter only.
    """
    turn, level = look.environment_turn, 2.0**look.light_level
    if has_corners:
        turn = QUARTER * round(turn / QUARTER)
    color = level * temperature_color(look.light_temperature)
    if turn % 360 == 0 and (color == 1).all():
        return environment
    radiance = turned(environment.radiance, turn) * color.astype(np.float32)
    return replace(environment, radiance=radiance, level=level * environment.level)


def turned(radiance: np.ndarray, degrees: float) -> np.ndarray:
    """Return a panorama turned counterclockwise as seen from above.

    Between columns it is linear in radiance, so that no light is lost.

    Args:
        radiance: equirectangular as in `digs_warp.sim.scene.environment`, shape (height, width, 3), float32.
        degrees: any angle.
    """
    shift = (degrees / 360 % 1.0) * radiance.shape[1]
    # Going right in the image turns clockwise: what was to the right comes to a column.
    columns = int(shift)
    share = np.float32(shift - columns)
    near = np.roll(radiance, -columns, axis=1)
    if share == 0:
        return near
    return (1 - share) * near + share * np.roll(near, -1, axis=1)


def temperature_color(kelvin: float) -> np.ndarray:
    """Return the factors on linear red, green and blue, (3,), that turn neutral light into a black body's.

    They keep the luminance of white, and are exactly 1 at `NEUTRAL_TEMPERATURE`.
    """
    color = _black_body(kelvin) / _black_body(NEUTRAL_TEMPERATURE)
    return color / (LUMINANCE @ color)


def _black_body(kelvin: float) -> np.ndarray:
    """Return the linear sRGB color of a black body, 1667 to 25,000 K, at luminance 1.

    Its chromaticity is the cubic spline of Kim et al., US patent 7024034 (2006).
    """
    k = 1e3 / kelvin
    if kelvin <= 4000:
        x = -0.2661239 * k**3 - 0.2343589 * k**2 + 0.8776956 * k + 0.179910
    else:
        x = -3.0258469 * k**3 + 2.1070379 * k**2 + 0.2226347 * k + 0.240390
    if kelvin <= 2222:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif kelvin <= 4000:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    color = SRGB_FROM_XYZ @ np.array([x / y, 1.0, (1 - x - y) / y])
    return np.maximum(color, 0.0)
