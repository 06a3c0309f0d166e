"""The surround of the scene: a panorama on a sphere, which is also the light source."""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, check_finite, check_positive, check_shape
from digs_warp.data.images import linear_from_srgb, read_image
from digs_warp.sim.scene.studio_room import studio_room_radiance
from digs_warp.sim.scene.surround import Surround

_log = logging.getLogger(__name__)

# Near enough that the walls move from frame to frame (structure from motion needs them), far enough that
# three orbits at about 0.9 m stay well inside.
DEFAULT_RADIUS = 4.0

# A panorama is twice as wide as high; stitching tools deviate by a few pixels at most.
ASPECT_TOLERANCE = 0.02


@dataclass(frozen=True, eq=False)
class Environment:
    """A luminous surround of the scene.

    Attributes:
        radiance: linear RGB, equirectangular as in `digs_warp.sim.scene.panorama`, shape (height, width, 3),
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
        check_finite("environment radiance", radiance)
        check_positive("environment radius", self.radius)
        check_positive("environment level", self.level)
        object.__setattr__(self, "radiance", np.ascontiguousarray(np.maximum(radiance, 0.0)))

    @property
    def surround(self) -> Surround:
        """Where the radiance is."""
        if self.floor is None:
            return Surround.sphere(self.radius)
        make = Surround.room if self.is_room else Surround.dome
        return make(self.floor, self.radius)


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


def procedural_environment(radius: float = DEFAULT_RADIUS) -> Environment:
    """Return the built-in studio room: textured all around, lit by windows and soft boxes."""
    return Environment(studio_room_radiance(), radius, is_room=True)
