"""The surround of the scene: a panorama on a sphere, dome or room, which is also the light source.

The object stands on its floor, or on a table on that.
"""

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from digs_warp.checks import DigsError, check_finite, check_shape
from digs_warp.data.images import linear_from_srgb, read_image
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Scene

_log = logging.getLogger(__name__)

# Where panoramas are taken [m]: from a tripod at eye level, and not right above the object: straight down
# they show the tripod or its retouched place, and their texels become ever narrower.
PHOTOGRAPHER_HEIGHT = 1.6
PHOTOGRAPHER_ASIDE = 1.0

# Height of a room over its width.
ROOM_HEIGHT = 0.7


@dataclass(frozen=True)
class Surround:
    """A sphere, a sphere cut by a floor (dome), or a box (room); z is up, metres.

    A place on the boundary shows what the panorama shows in its direction from ``center``; in a room, in the
    direction that it would have in a cube.

    Attributes:
        center: middle of sphere or box, and where the panorama was taken, (x, y, z).
        radius: of the sphere; of a room: half its width.
        floor: height of the floor; None: the whole sphere.
        is_room: whether the boundary is a box.
    """

    center: tuple[float, float, float]
    radius: float
    floor: float | None = None
    is_room: bool = False

    @property
    def half_size(self) -> np.ndarray:
        """Half the sides of a room, (3,)."""
        return self.radius * np.array([1.0, 1.0, ROOM_HEIGHT])

    def holds(self, point: np.ndarray) -> bool:
        """Whether a point, (3,), is inside."""
        away = point - np.array(self.center)
        if self.is_room:
            return bool((np.abs(away) < self.half_size).all())
        above = self.floor is None or point[2] > self.floor
        return bool(above and np.linalg.norm(away) < self.radius)


def panorama_directions(width: int, height: int) -> np.ndarray:
    """Return the unit direction of each panorama pixel's center, shape (height, width, 3)."""
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    polar = ((np.arange(height) + 0.5) / height * np.pi)[:, None]
    ring = np.sin(polar)
    return np.stack(
        [ring * np.cos(azimuth), ring * np.sin(azimuth), np.cos(polar) + 0 * azimuth], axis=-1
    )


def solid_angles(width: int, height: int) -> np.ndarray:
    """Return the solid angle of each panorama row's pixels [sr], shape (height, 1)."""
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    return ((edges[:-1] - edges[1:]) * 2 * np.pi / width)[:, None]


# Near enough that the walls move from frame to frame (structure from motion needs them), far enough that
# three orbits at about 0.9 m stay well inside.
DEFAULT_RADIUS = 4.0

# A panorama is twice as wide as high; stitching tools deviate by a few pixels at most.
ASPECT_TOLERANCE = 0.02


@dataclass(frozen=True, eq=False)
class Environment:
    """A luminous surround of the scene.

    Attributes:
        radiance: linear RGB, equirectangular as in `panorama_directions`, shape (height, width, 3),
            float32, finite, >= 0.
        radius: radius of the sphere [m]; of a room: half its width.
        level: its light against that which the exposure of a recording is set for, > 0.
        floor: height of the floor [m]; None: a whole sphere around the origin.
        is_room: whether the radiance shows a cube from its middle, so that it fits a box with a floor.
    """

    radiance: np.ndarray
    radius: float = DEFAULT_RADIUS
    level: float = 1.0
    floor: float | None = None
    is_room: bool = False

    def __post_init__(self) -> None:
        radiance = np.asarray(self.radiance, dtype=np.float32)
        check_shape("environment radiance", radiance, (None, None, 3))
        object.__setattr__(self, "radiance", np.ascontiguousarray(np.maximum(radiance, 0.0)))

    @property
    def surround(self) -> Surround:
        """Where the radiance is."""
        if self.floor is None:
            return Surround((0.0, 0.0, 0.0), self.radius)
        place = (PHOTOGRAPHER_ASIDE, 0.0, self.floor + PHOTOGRAPHER_HEIGHT)
        if self.is_room:
            place = (0.0, 0.0, self.floor + ROOM_HEIGHT * self.radius)
        return Surround(place, self.radius, self.floor, self.is_room)


def load_environment(path: Path, radius: float = DEFAULT_RADIUS) -> Environment:
    """Read an equirectangular panorama: HDR and EXR are linear, 8- and 16-bit images are sRGB.

    Raises:
        DigsError: the file is missing, truncated, not an image, not twice as wide as high, or has NaN or
            infinite values.
    """
    path = Path(path)
    pixels = read_image(path, what="environment")
    height, width, channels = pixels.shape
    if abs(width - 2 * height) > max(1.0, ASPECT_TOLERANCE * width):
        raise DigsError(
            f"environment '{path}': {width}x{height} pixels, expected an equirectangular panorama, "
            "twice as wide as high; convert it (a cube map or a photo will not work)"
        )
    if pixels.dtype.kind == "u":
        # By a table: computed for each pixel, a panorama of 8192 x 4096 takes gigabytes.
        largest = np.iinfo(pixels.dtype).max
        linear = linear_from_srgb(np.arange(largest + 1, dtype=np.float32) / largest)[pixels]
    else:
        linear = _finite(path, pixels)
    # One channel is gray, two are gray and alpha, four are color and alpha.
    linear = linear[..., :3] if channels >= 3 else np.repeat(linear[..., :1], 3, axis=-1)
    if not (linear > 0).any():
        # A valid test of the sensor, but more often the wrong file.
        _log.warning(
            "environment '%s': every pixel is black; without light only emissive parts of the object are "
            "visible, and a stereo camera measures nothing",
            path,
        )
    return Environment(linear, radius)


def _finite(path: Path, pixels: np.ndarray) -> np.ndarray:
    """Return the pixels, or raise a `DigsError` that says how to mend them: suns are often infinite."""
    try:
        return check_finite(f"environment '{path}'", pixels)
    except DigsError as error:
        # The tool comes with OpenImageIO.
        mended = f"oiiotool '{path}' --fixnan box3 -o mended{path.suffix}"
        raise DigsError(f"{error}; mend them with: {mended}") from None


Ground = Literal["auto", "floor", "table", "none"]

# Smallest radius of the dome over a floor, and half the width of the built-in room [m].
DOME_RADIUS = 6.0
ROOM_HALF_WIDTH = 2.0

# The walls are at least this many times as far away as the camera.
SURROUND_MARGIN = 1.75

# Height of a table [m], and the longest side of what is put on one rather than on the floor.
TABLE_HEIGHT = 0.75
TABLE_THINGS = 0.55

# Largest spread of several objects on a table [m].
TABLE_SPREAD = 1.5


def set_up(
    scene: Scene, environment: Environment, ground: Ground, farthest: float
) -> tuple[Scene, Environment, Ground]:
    """Return the objects on their ground, a surround that is large enough for a walk, and the ground chosen.

    Args:
        scene: the objects.
        environment: as it was loaded.
        ground: "auto": a table for small objects, a floor for large ones and in the built-in room, which has
            one; "none": a sphere around the objects.
        farthest: distance of the camera from the origin, at most [m].
    """
    beyond = SURROUND_MARGIN * farthest
    if ground == "none":
        wide = replace(environment, radius=max(environment.radius, beyond))
        return scene, wide, ground
    if ground == "auto":
        ground = "table" if _fit_a_table(scene) and not environment.is_room else "floor"
    least = ROOM_HALF_WIDTH if environment.is_room else DOME_RADIUS
    things = np.stack([scene.vertices.min(axis=0), scene.vertices.max(axis=0)])
    floor = top = float(scene.object_vertices[:, 2].min())
    if ground == "table":
        from digs_warp.sim.scene.table import table_scene

        floor = top - TABLE_HEIGHT
        scene = join_scenes(scene, table_scene(top, floor, things.astype(np.float64)))
    return scene, replace(environment, radius=max(least, beyond), floor=floor), ground


def _fit_a_table(scene: Scene) -> bool:
    """Whether people would put the objects on a table."""
    largest = max((float(each.size.max()) for each in scene.objects), default=scene.size.max())
    return bool(largest <= TABLE_THINGS and scene.size.max() <= TABLE_SPREAD)
