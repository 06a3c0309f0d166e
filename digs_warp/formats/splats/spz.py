"""Gaussians as SPZ, the compressed format of Niantic: about a tenth of a PLY, with no visible difference.

The file's frame is the one of OpenGL: x right, **y up**, z to the viewer (RUB). Our world (z up) is turned
into it and back: positions, orientations and spherical harmonics.

Readers add 0.3 px^2 to splats on the screen; a flag says whether they keep the opacity of small ones
(antialiased). The format cannot say that nothing is to be added: such scenes get the flag.
"""

import logging
from pathlib import Path

import numpy as np

from digs_warp.bounds import GAUSSIANS
from digs_warp.checks import DigsError
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, FIELDS, Gaussians
from digs_warp.formats.splats.rows import (
    WORLD_FROM_Y_UP,
    codes_from_logits,
    logits_from_codes,
    nearest_known,
    quats_from_three,
    smallest_three,
    turned,
    warn_of_loss,
    warn_of_offset,
)
from digs_warp.formats.splats.spz_container import (
    PackedSplats,
    read_spz_container,
    stream_sizes,
    write_spz_container,
)
from digs_warp.geometry.sh import MAX_DEGREE, coefficient_count

logger = logging.getLogger(__name__)

LOG_SCALE_STEPS = 16.0  # per unit
LOWEST_LOG_SCALE = -10.0

# The base coefficient as 0..255 around the middle: wide enough for colors beyond 0..1 that the higher
# bands bring back.
COLOR_SCALE = 0.15

SH_STEPS = 128.0  # per unit
SH_ZERO = 128

# Of the 8 bits of the coefficients of band 1, and of the bands above, these are used, which lets gzip shrink
# the file: the reference implementation's default.
SH_BITS = (5, 4)

_SQRT_HALF = np.sqrt(0.5)
_MAGNITUDE_BITS = 9
_LARGEST_MAGNITUDE = (1 << _MAGNITUDE_BITS) - 1
_SHIFTS = tuple(np.uint32(shift) for shift in (20, 10, 0))


def encode_positions(positions: np.ndarray, fractional_bits: int) -> bytes:
    """Return 24-bit fixed-point numbers of positions (n, 3) that fit."""
    fixed = np.rint(positions.astype(np.float64) * 2.0**fractional_bits).astype("<i4")
    return fixed.reshape(-1, 1).view(np.uint8)[:, :3].tobytes()


def decode_positions(data: bytes | memoryview, fractional_bits: int) -> np.ndarray:
    """Return positions, shape (n, 3), float32."""
    fixed = np.zeros((len(data) // 3, 4), dtype=np.uint8)
    fixed[:, 1:] = np.frombuffer(data, dtype=np.uint8).reshape(-1, 3)
    # In the upper three bytes: the shift to the right extends the sign.
    values = (fixed.view("<i4")[:, 0] >> 8) * 2.0**-fractional_bits
    return values.reshape(-1, 3).astype(np.float32)


def encode_log_scales(log_scales: np.ndarray) -> bytes:
    """Return natural logarithms of standard deviations, (n, 3), as bytes."""
    return _to_bytes((log_scales.astype(np.float64) - LOWEST_LOG_SCALE) * LOG_SCALE_STEPS)


def decode_log_scales(data: bytes | memoryview) -> np.ndarray:
    """Return log-scales, shape (n, 3), float32."""
    codes = np.frombuffer(data, dtype=np.uint8).astype(np.float32).reshape(-1, 3)
    return codes / LOG_SCALE_STEPS + LOWEST_LOG_SCALE


def encode_colors(base: np.ndarray) -> bytes:
    """Return SH coefficients of band 0, (n, 3), as bytes."""
    return _to_bytes(255.0 * (COLOR_SCALE * base.astype(np.float64) + 0.5))


def decode_colors(data: bytes | memoryview) -> np.ndarray:
    """Return coefficients of band 0, shape (n, 3), float32."""
    codes = np.frombuffer(data, dtype=np.uint8).astype(np.float64).reshape(-1, 3)
    return ((codes / 255.0 - 0.5) / COLOR_SCALE).astype(np.float32)


def encode_sh(rest: np.ndarray, bits: tuple[int, int] = SH_BITS) -> bytes:
    """Return the coefficients above band 0, (n, K - 1, 3), as bytes; rounded to bits as of `SH_BITS`."""
    bucket = np.full(rest.shape[1], 1 << 8 - bits[1])
    bucket[:3] = 1 << 8 - bits[0]
    steps = (rest * np.float32(SH_STEPS) + np.float32(SH_ZERO)) / bucket[:, None].astype(np.float32)
    return _to_bytes(np.rint(steps) * bucket[:, None])


def decode_sh(data: bytes | memoryview, count: int, degree: int) -> np.ndarray:
    """Return the coefficients above band 0, shape (count, K - 1, 3), float32."""
    codes = np.frombuffer(data, dtype=np.uint8).astype(np.float32)
    return ((codes - SH_ZERO) / SH_STEPS).reshape(count, (degree + 1) ** 2 - 1, 3)


def encode_quats_first_three(quats: np.ndarray) -> bytes:
    """Return x, y, z of unit quaternions xyzw, (n, 4), as bytes (version 2); w follows from them."""
    upright = np.where(quats[:, 3:] < 0, -quats, quats)
    return _to_bytes(127.5 * upright[:, :3] + 127.5)


def decode_quats_first_three(data: bytes | memoryview) -> np.ndarray:
    """Return quaternions xyzw with w >= 0, shape (n, 4), float32."""
    xyz = np.frombuffer(data, dtype=np.uint8).astype(np.float64).reshape(-1, 3) / 127.5 - 1.0
    w = np.sqrt(np.maximum(0.0, 1.0 - np.einsum("ni,ni->n", xyz, xyz)))
    return np.column_stack([xyz, w]).astype(np.float32)


def encode_quats_smallest_three(quats: np.ndarray) -> bytes:
    """Return unit quaternions xyzw, (n, 4), as 32 bits each (version 3 on).

    Two bits name the largest component, which is left out and taken as positive; the others follow with
    a sign bit and 9 bits in units of sqrt(1/2) / 511.
    """
    largest, others = smallest_three(quats)
    magnitudes = np.floor(_LARGEST_MAGNITUDE / _SQRT_HALF * np.abs(others) + 0.5).astype(np.uint32)
    fields = (others < 0).astype(np.uint32) << _MAGNITUDE_BITS | magnitudes
    packed = largest.astype(np.uint32) << 30
    for field, shift in zip(fields.T, _SHIFTS, strict=True):
        packed |= field << shift
    return packed.astype("<u4").tobytes()


def decode_quats_smallest_three(data: bytes | memoryview) -> np.ndarray:
    """Return quaternions xyzw, shape (n, 4), float32."""
    packed = np.frombuffer(data, dtype="<u4")
    fields = packed[:, None] >> np.array(_SHIFTS, np.uint32)
    magnitudes = (fields & _LARGEST_MAGNITUDE) * (_SQRT_HALF / _LARGEST_MAGNITUDE)
    others = np.where(fields >> _MAGNITUDE_BITS & 1, -magnitudes, magnitudes)
    return quats_from_three(packed >> 30, others)


def _to_bytes(values: np.ndarray) -> bytes:
    """Return values rounded to the nearest of 0..255."""
    return np.rint(values).clip(0, 255).astype(np.uint8).tobytes()


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
        screen_filter=ANTIALIASED if packed.antialiased else CLASSIC,
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
    decode_quats = decode_quats_first_three if packed.version == 2 else decode_quats_smallest_three
    rest = decode_sh(streams["sh"], rows.stop - rows.start, packed.degree)
    rest = rest[:, : coefficient_count(min(packed.degree, MAX_DEGREE)) - 1]
    base = decode_colors(streams["colors"])
    return Gaussians(
        means=decode_positions(streams["positions"], packed.fractional_bits),
        log_scales=decode_log_scales(streams["scales"]),
        quats=decode_quats(streams["rotations"]),
        opacity_logits=logits_from_codes(np.frombuffer(streams["alphas"], dtype=np.uint8)),
        sh=np.concatenate([base[:, None], rest], axis=1),
    )


def write_spz(
    path: Path,
    gaussians: Gaussians,
    version: int = DEFAULT_VERSION,
    sh_bits: tuple[int, int] = SH_BITS,
) -> None:
    """Write Gaussians of our world (z up); values outside its ranges are clipped, with a warning.

    Args:
        path: the file.
        gaussians: finite values only.
        version: 3 (read by all programs), 4 (Zstandard, newer ones), 2 (8-bit quaternions, oldest ones).
        sh_bits: of the coefficients of band 1, and of the bands above, 1 to 8.

    Raises:
        DigsError: too many Gaussians, or positions beyond 8 million metres.
    """
    what = f"SPZ '{path}'"
    GAUSSIANS.check(what, len(gaussians))
    _warn_of_cuts(gaussians, what)
    warn_of_offset(gaussians, what)
    splats = turned(gaussians, WORLD_FROM_Y_UP.T)
    bits = _fractional_bits(splats.means, what)
    # `turned` returns unit quaternions.
    quats = splats.quats.astype(np.float64)
    encode_quats = encode_quats_first_three if version == 2 else encode_quats_smallest_three
    streams = {
        "positions": encode_positions(splats.means, bits),
        "alphas": codes_from_logits(splats.opacity_logits).tobytes(),
        "colors": encode_colors(splats.sh[:, 0]),
        "scales": encode_log_scales(splats.log_scales),
        "rotations": encode_quats(quats),
        "sh": encode_sh(splats.sh[:, 1:], sh_bits),
    }
    antialiased = nearest_known(gaussians.screen_filter).antialias
    packed = PackedSplats(version, len(splats), splats.sh_degree, bits, antialiased, streams)
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
    lowest = LOWEST_LOG_SCALE
    small = (gaussians.log_scales < lowest).any(axis=1)
    large = (gaussians.log_scales > lowest + 255 / LOG_SCALE_STEPS).any(axis=1)
    warn_of_loss(
        int(small.sum()), total, what, f"are thinner than {np.exp(lowest):.1g} m: thickened"
    )
    warn_of_loss(int(large.sum()), total, what, "are larger than 380 m: cut")
    colors = (np.abs(gaussians.sh[:, 0]) > 0.5 / COLOR_SCALE).any(axis=1)
    warn_of_loss(int(colors.sum()), total, what, "have colors far beyond 0..1: cut")
    rest = (np.abs(gaussians.sh[:, 1:]) > 1.0).any(axis=(1, 2))
    warn_of_loss(int(rest.sum()), total, what, "have SH coefficients beyond 1: cut")
