"""The largest inputs: a few bytes can promise billions of pixels, rows or levels; headers are checked first.

Each bound lies well above real files. docs/bounds.md lists them all.
"""

from dataclasses import dataclass

from digs_warp.checks import DigsError

MIB = 1 << 20


@dataclass(frozen=True)
class Bound:
    """The most that an input may hold.

    Attributes:
        most: the largest number that passes.
        unit: of what, in the plural.
        remedy: what to do with a file that holds more.
    """

    most: int
    unit: str
    remedy: str

    def check(self, what: str, found: int) -> None:
        """Raise a `DigsError` when ``what``, a file with its path, has more than the bound."""
        if found > self.most:
            raise DigsError(
                f"{what}: {found:,} {self.unit}, expected up to {self.most:,}; {self.remedy}"
            )


# A panorama of 16384 x 8192. Photographs have up to 150 million.
IMAGE = Bound(1 << 27, "pixels", "scale it down")
# Four of each pixel; EXR files may hold any number of layers.
IMAGE_VALUES = Bound(1 << 29, "values in all channels", "export fewer channels, or scale it down")
# 8192 x 8192, the most that graphics programs use.
TEXTURE = Bound(1 << 26, "pixels", "scale the texture down to 8192 x 8192 or less")
# Three times a scan of ten million triangles.
TRIANGLES = Bound(1 << 25, "triangles", "decimate it, for example with MeshLab")
# The header of a recording of an hour and a half at 10 frames per second takes about this.
JSON = Bound(32 * MIB, "bytes of JSON", "split the recording")
# A glTF file with its buffers and textures inside.
GLTF_TEXT = Bound(256 * MIB, "bytes", "export it as GLB")
# A list of an hour of poses at 100 per second takes half of this.
TEXT = Bound(64 * MIB, "bytes of text", "split the recording")
# A profile or settings take a few kilobytes.
SETTINGS = Bound(1 * MIB, "bytes", "is it the right file?")
# Brackets in JSON or YAML; ours have eight levels.
LEVELS = Bound(100, "levels of brackets", "is it the right file?")
# The limit of the reference implementation of SPZ. Degree 3 takes 2.4 GB in memory.
GAUSSIANS = Bound(10_000_000, "Gaussians", "split it, or drop the faintest with its own program")

# A compressed file may unpack to this many times its size, and to this much more. Real ones unpack to twice.
MOST_UNPACKED_RATIO = 32
FREE_UNPACKED = 16 * MIB


def check_unpacked(what: str, size: int, unpacked: int) -> None:
    """Raise a `DigsError` when a file claims to unpack to far more than such files do.

    Args:
        what: the file with its path.
        size: its length [bytes].
        unpacked: the length that its header claims [bytes].
    """
    most = FREE_UNPACKED + MOST_UNPACKED_RATIO * size
    if unpacked > most:
        raise DigsError(
            f"{what}: claims to unpack from {size:,} to {unpacked:,} bytes, expected up to {most:,}; "
            "damaged, or a compression bomb; write it again without compression if it is neither"
        )


_MANY = 1_000_000.0
_SEED = (0, 2**31 - 1)
# Gaussians and points on the way to them; see `GAUSSIANS`.
_SPLATS = (1, GAUSSIANS.most)
# A picture of 8192 x 8192 pixels takes several gigabytes while it is made.
_SIDE = (1, 8192)

# Flag -> the smallest and the largest value. Far beyond what makes sense, within what ends.
FLAGS: dict[str, tuple[float, float]] = {
    "--background-weight": (1, _MANY),
    "--case-memory": (1e-3, _MANY),
    "--case-threads": (1, 1024),
    "--case-time": (1e-9, 366 * 86_400),
    "--colors-rate": (1e-12, 1000),
    "--confidence-threshold": (0, 1),
    "--cores": (1, 1_000_000),
    "--coverage-weight": (0, _MANY),
    "--depth-weight": (0, _MANY),
    "--disparity-noise": (1e-6, 1000),
    "--distance": (0.01, 1000),
    "--distance-factor": (0.1, 10),
    "--distances": (0.01, 1000),
    "--distractors": (0, 100),
    "--dropped-frames": (0, 0.9),
    "--dssim-weight": (0, 1),
    # A recording of three hours.
    "--duration": (0.01, 10_800),
    "--elevation-deg": (-89.9, 89.9),
    "--elevations": (-80, 80),
    "--environment-turn": (-360, 360),
    "--evaluate-at": (0, 10_000_000),
    # Longer than any video camera's; a larger number was meant in milliseconds.
    "--exposure-time": (0, 1),
    "--feature-size": (32, 16_384),
    "--features": (50, 100_000),
    "--fov-deg": (0.1, 179),
    "--fps": (0.01, 1000),
    "--frames": (1, 100_000),
    "--half-size-until": (0, 1),
    "--height": _SIDE,
    "--image-memory": (1e-12, _MANY),
    "--instance": (1, 65_535),
    "--iterations": (0, 10_000_000),
    "--light-level": (-10, 10),
    # The range of black bodies whose blue is not negative in sRGB.
    "--light-temperature": (2000, 25_000),
    "--loop-images": (0, 1000),
    "--machine-factor": (1e-3, 1000),
    "--mask-error": (0, 10),
    "--mask-threshold": (0, 254),
    "--max-points": _SPLATS,
    "--max-splats": _SPLATS,
    "--means-rate": (1e-12, 1000),
    "--min-registered": (1e-6, 1),
    "--min-support": (0, 1),
    "--object-size": (0.001, 100),
    "--object-turn": (-360, 360),
    "--objects": (1, 1000),
    "--opacities-rate": (1e-12, 1000),
    "--opacity": (1e-6, 1 - 1e-6),
    "--opacity-weight": (0, _MANY),
    "--overlap": (1, 1000),
    "--port": (1, 65_535),
    "--price": (0, _MANY),
    "--quats-rate": (1e-12, 1000),
    "--rates-end": (1e-6, 1000),
    "--recommended": (1e-9, 366 * 86_400),
    "--rotation-error-deg": (0, 180),
    "--roughness-factor": (0, 100),
    "--samples-per-pixel": (1, 4096),
    "--scale-weight": (0, _MANY),
    "--scales-rate": (1e-12, 1000),
    "--scenes": (1, 100_000),
    "--seconds": (0.01, 3600),
    "--seed": _SEED,
    "--seeds": (1, 1000),
    "--sh-degree": (0, 3),
    "--shake": (0, 10),
    "--speed": (0.001, 100),
    "--splat-memory": (1e-3, _MANY),
    "--splat-width": (1e-3, 1000),
    "--splats": _SPLATS,
    "--strength": (0, 100),
    "--target-points": _SPLATS,
    "--target-psnr": (1e-3, 100),
    # Holding out every view would leave none to train on.
    "--test-every": (2, 1_000_000),
    # A year: no machine is lent for longer.
    "--time-budget": (1e-9, 366 * 86_400),
    "--time-jitter": (0, 10),
    "--tint": (0, 1),
    "--tint-hue": (-360, 360),
    "--trajectories": (1, 10_000),
    "--translation-error": (0, 100),
    "--unsteadiness": (0, 4),
    "--views": (3, 10_000),
    # From a thousandth of a millimetre.
    "--voxel-size": (1e-6, 100),
    "--width": _SIDE,
    "--workers": (1, 1024),
}


def check_flag(flag: str, value: float | None) -> None:
    """Raise a `DigsError` when the value of a flag is not in its range in `FLAGS`; None passes."""
    low, high = FLAGS[flag]
    if value is not None and not low <= value <= high:  # NaN is not
        raise DigsError(f"{flag}: {value!r}, expected {low:,.10g} to {high:,.10g}")
