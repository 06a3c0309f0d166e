"""Gaussians as SPZ, the compressed format of Niantic: about a tenth of a PLY, with no visible difference.

The file's frame is the one of OpenGL: x right, **y up**, z to the viewer (RUB). Our world (z up) is turned
into it and back: positions, orientations and spherical harmonics.
"""

import logging
from pathlib import Path

import numpy as np

from digs_warp.bounds import GAUSSIANS
from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.formats.splats import spz_codes as codes
from digs_warp.formats.splats.rows import (
    WORLD_FROM_Y_UP,
    codes_from_logits,
    logits_from_codes,
    turned,
    warn_of_loss,
)
from digs_warp.formats.splats.spz_container import (
    PackedSplats,
    read_spz_container,
    stream_sizes,
    write_spz_container,
)
from digs_warp.geometry.sh import MAX_DEGREE, coefficient_count

logger = logging.getLogger(__name__)

DEFAULT_VERSION = 3

ROWS_AT_A_TIME = 1 << 17

# Positions have 24 bits. The fraction gets those that the largest coordinate does not need, at most this
# many: steps of a micrometre, finer than any splat.
MOST_FRACTIONAL_BITS = 20
_LARGEST_FIXED = (1 << 23) - 1


def read_spz(path: Path) -> Gaussians:
    """Read Gaussians of versions 2, 3 and 4 into our world (z up).

    Raises:
        DigsError: not an SPZ file, truncated or damaged.
    """
    packed = read_spz_container(path)
    if packed.degree > MAX_DEGREE:
        logger.warning(
            "SPZ '%s': colors of degree %d are read up to %d", path, packed.degree, MAX_DEGREE
        )
    count, degree = packed.count, min(packed.degree, MAX_DEGREE)
    read = Gaussians(
        means=np.empty((count, 3), np.float32),
        log_scales=np.empty((count, 3), np.float32),
        quats=np.empty((count, 4), np.float32),
        opacity_logits=np.empty(count, np.float32),
        sh=np.empty((count, coefficient_count(degree), 3), np.float32),
    )
    # Decoding takes several times the memory of its result.
    for start in range(0, count, ROWS_AT_A_TIME):
        rows = slice(start, min(start + ROWS_AT_A_TIME, count))
        part = turned(_decoded(packed, rows), WORLD_FROM_Y_UP)
        for name in FIELDS:
            getattr(read, name)[rows] = getattr(part, name)
    return read


def _decoded(packed: PackedSplats, rows: slice) -> Gaussians:
    """Return some of the Gaussians, in the frame of the file."""
    sizes = stream_sizes(packed.version, 1, packed.degree)
    streams = {
        name: memoryview(packed.streams[name])[rows.start * size : rows.stop * size]
        for name, size in sizes.items()
    }
    decode_quats = (
        codes.decode_quats_first_three if packed.version == 2 else codes.decode_quats_smallest_three
    )
    rest = codes.decode_sh(streams["sh"], rows.stop - rows.start, packed.degree)
    rest = rest[:, : coefficient_count(min(packed.degree, MAX_DEGREE)) - 1]
    base = codes.decode_colors(streams["colors"])
    return Gaussians(
        means=codes.decode_positions(streams["positions"], packed.fractional_bits),
        log_scales=codes.decode_log_scales(streams["scales"]),
        quats=decode_quats(streams["rotations"]),
        opacity_logits=logits_from_codes(np.frombuffer(streams["alphas"], dtype=np.uint8)),
        sh=np.concatenate([base[:, None], rest], axis=1),
    )


def write_spz(path: Path, gaussians: Gaussians, version: int = DEFAULT_VERSION) -> None:
    """Write Gaussians of our world (z up); values outside its ranges are clipped, with a warning.

    Args:
        path: the file.
        gaussians: finite values only.
        version: 3 (read by all programs), 4 (Zstandard, newer ones), 2 (8-bit quaternions, oldest ones).

    Raises:
        DigsError: too many Gaussians, or positions beyond 8 million metres.
    """
    what = f"SPZ '{path}'"
    GAUSSIANS.check(what, len(gaussians))
    _warn_of_cuts(gaussians, what)
    splats = turned(gaussians, WORLD_FROM_Y_UP.T)
    bits = _fractional_bits(splats.means, what)
    # `turned` returns unit quaternions.
    quats = splats.quats.astype(np.float64)
    encode_quats = (
        codes.encode_quats_first_three if version == 2 else codes.encode_quats_smallest_three
    )
    streams = {
        "positions": codes.encode_positions(splats.means, bits),
        "alphas": codes_from_logits(splats.opacity_logits).tobytes(),
        "colors": codes.encode_colors(splats.sh[:, 0]),
        "scales": codes.encode_log_scales(splats.log_scales),
        "rotations": encode_quats(quats),
        "sh": codes.encode_sh(splats.sh[:, 1:]),
    }
    packed = PackedSplats(version, len(splats), splats.sh_degree, bits, False, streams)
    write_spz_container(path, packed)


def _fractional_bits(positions: np.ndarray, what: str) -> int:
    largest = float(np.abs(positions).max(initial=0.0))
    if largest > _LARGEST_FIXED:
        raise DigsError(
            f"{what}: positions as far as {largest:.3g} m from the origin, the format holds "
            f"{_LARGEST_FIXED:.3g} m; remove the outliers or write PLY"
        )
    bits = MOST_FRACTIONAL_BITS
    while largest * 2.0**bits > _LARGEST_FIXED:
        bits -= 1
    return bits


def _warn_of_cuts(gaussians: Gaussians, what: str) -> None:
    """Log how many Gaussians are outside the ranges of the format."""
    total = len(gaussians)
    lowest = codes.LOWEST_LOG_SCALE
    small = (gaussians.log_scales < lowest).any(axis=1)
    large = (gaussians.log_scales > lowest + 255 / codes.LOG_SCALE_STEPS).any(axis=1)
    warn_of_loss(
        int(small.sum()), total, what, f"are thinner than {np.exp(lowest):.1g} m: thickened"
    )
    warn_of_loss(int(large.sum()), total, what, "are larger than 380 m: cut")
    colors = (np.abs(gaussians.sh[:, 0]) > 0.5 / codes.COLOR_SCALE).any(axis=1)
    warn_of_loss(int(colors.sum()), total, what, "have colors far beyond 0..1: cut")
    rest = (np.abs(gaussians.sh[:, 1:]) > 1.0).any(axis=(1, 2))
    warn_of_loss(int(rest.sum()), total, what, "have SH coefficients beyond 1: cut")
