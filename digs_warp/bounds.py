"""The largest inputs: a few bytes can promise billions of pixels, rows or levels; headers are checked first.

Each bound lies well above real files. docs/troubleshooting.md lists them all.
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
