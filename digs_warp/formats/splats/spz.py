"""Gaussians as SPZ, the compressed format of Niantic (github.com/nianticlabs/spz): a fourteenth of a PLY.

The frame is that of OpenGL: x right, **y up**, z to the viewer. Versions 2 and 3 are one gzip stream: a
header of 16 bytes, then the attributes one after the other. Version 4 has a header of 32 bytes, a table with
the lengths of each attribute (compressed, not compressed), and a Zstandard frame for each. All are read, 3 is
written.

Readers add 0.3 px^2 to splats on the screen; a flag says whether they keep the opacity of small ones
(antialiased). The format cannot say that nothing is to be added: such scenes get the flag.
"""

import logging
import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from digs_warp.bounds import GAUSSIANS, check_unpacked
from digs_warp.checks import DigsError, require_file
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, FIELDS, Gaussians
from digs_warp.formats.splats.rows import (
    WORLD_FROM_Y_UP,
    codes_from_logits,
    known_coefficients,
    logits_from_codes,
    nearest_known,
    quats_from_three,
    smallest_three,
    sound,
    turned,
)
from digs_warp.geometry.sh import MAX_DEGREE, coefficient_count
from digs_warp.record.files import write_atomically

logger = logging.getLogger(__name__)

MAGIC, VERSION, VERSIONS = 0x5053474E, 3, (2, 3, 4)  # "NGSP"
_ANTIALIASED, _EXTENSIONS = 1, 2  # flags
# Magic, version, count, degree, fractional bits, flags, streams.
_HEADER = struct.Struct("<IIIBBBB")
_GZIP = 16 + zlib.MAX_WBITS
# Higher levels take several times as long and save only one or two percent.
_GZIP_LEVEL = 3

# Bytes of a Gaussian in each attribute, in the order of the file; the last: of each coefficient.
_BYTES = {"positions": 9, "alphas": 1, "colors": 3, "scales": 3, "rotations": 4, "sh": 3}

LOG_SCALE_STEPS, LOWEST_LOG_SCALE = 16.0, -10.0
# The base coefficient as 0..255 around the middle: wide enough for colors beyond 0..1, which higher bands
# bring back.
COLOR_SCALE = 0.15
SH_STEPS, SH_ZERO = 128.0, 128
# Of the 8 bits of the coefficients of band 1, and of the bands above, these are used, which lets gzip shrink
# the file: the reference implementation's default.
SH_BITS = (5, 4)

_SQRT_HALF = np.sqrt(0.5)
_LARGEST_MAGNITUDE = (1 << 9) - 1
_SHIFTS = np.array((20, 10, 0), np.uint32)

_ROWS_AT_A_TIME = 1 << 17

# Positions have 24 bits. The fraction gets those that the largest coordinate does not need, at most this
# many: steps of a micrometre, finer than any splat.
MOST_FRACTIONAL_BITS = 20
_LARGEST_FIXED = (1 << 23) - 1


class _Header(NamedTuple):
    version: int
    count: int
    degree: int
    bits: int
    flags: int
    streams: int

    def sizes(self) -> dict[str, int]:
        """Return the length of each attribute [bytes]."""
        each = _BYTES | {"sh": 3 * ((self.degree + 1) ** 2 - 1)}
        if self.version == 2:
            each["rotations"] = 3
        return {name: self.count * size for name, size in each.items()}


def read_spz(path: Path) -> Gaussians:
    """Read Gaussians of versions 2, 3 and 4 into our world (z up); memory stays in proportion to the file.

    Raises:
        DigsError: not an SPZ file, truncated or damaged.
    """
    what = f"SPZ '{path}'"
    with sound(what):
        header, streams = _unpacked(require_file(path, "SPZ").read_bytes(), what)
    if header.flags & _EXTENSIONS:
        logger.warning("%s: extension records of other programs are skipped", what)
    count = header.count
    most = known_coefficients((header.degree + 1) ** 2, what)
    read = Gaussians(
        means=np.empty((count, 3), np.float32),
        log_scales=np.empty((count, 3), np.float32),
        quats=np.empty((count, 4), np.float32),
        opacity_logits=np.empty(count, np.float32),
        sh=np.empty((count, most, 3), np.float32),
        screen_filter=ANTIALIASED if header.flags & _ANTIALIASED else CLASSIC,
    )
    # Decoding takes several times the memory of its result.
    for start in range(0, count, _ROWS_AT_A_TIME):
        rows = slice(start, min(start + _ROWS_AT_A_TIME, count))
        part = {name: codes[rows] for name, codes in streams.items()}
        decoded = turned(_decoded(header, part), WORLD_FROM_Y_UP)
        for name in FIELDS:
            getattr(read, name)[rows] = getattr(decoded, name)
    return read


def _unpacked(data: bytes, what: str) -> tuple[_Header, dict[str, np.ndarray]]:
    """Return header and attributes, each (count, bytes), uint8."""
    if data.startswith(b"\x1f\x8b"):
        unpacker = zlib.decompressobj(_GZIP)
        header = _header(unpacker.decompress(data, _HEADER.size), what)
        if header.version > 3:
            raise DigsError(f"{what}: version {header.version} in a gzip stream; damaged")
        needed = sum(header.sizes().values())
        check_unpacked(what, len(data), needed)
        # One byte more: at the end of the stream its checksum is compared.
        body = unpacker.decompress(unpacker.unconsumed_tail, needed + 1)
        whole = unpacker.eof or bool(header.flags & _EXTENSIONS)
    else:
        header = _header(data, what)
        if header.version == 4:
            return header, _unpacked_streams(header, data, what)
        needed = sum(header.sizes().values())
        body, whole = data[_HEADER.size :], True
    if len(body) < needed or not (whole and (len(body) == needed or header.flags & _EXTENSIONS)):
        found = "more" if len(body) > needed else len(body)
        raise DigsError(
            f"{what}: {header.count} Gaussians need {needed} bytes, found {found}; truncated or damaged, "
            "copy or export it again"
        )
    return header, _split(header, body)


def _header(data: bytes, what: str) -> _Header:
    """Return what the first bytes say, within the bounds of the format."""
    magic, *rest = _HEADER.unpack_from(data) if len(data) >= _HEADER.size else (0,) * 7
    header = _Header(*rest)
    if magic != MAGIC:
        raise DigsError(
            f"{what}: begins with {data[:4]!r}, expected b'NGSP', or gzip and that inside"
        )
    if header.version not in VERSIONS:
        raise DigsError(f"{what}: version {header.version}, expected one of {VERSIONS}")
    GAUSSIANS.check(what, header.count)
    if header.degree > MAX_DEGREE + 1:
        raise DigsError(f"{what}: colors of degree {header.degree}, expected 0 to {MAX_DEGREE + 1}")
    if header.bits > 23:
        raise DigsError(f"{what}: {header.bits} fractional bits of 24-bit positions; damaged")
    return header


def _split(header: _Header, body: bytes) -> dict[str, np.ndarray]:
    streams, start = {}, 0
    for name, size in header.sizes().items():
        codes = np.frombuffer(body, np.uint8, size, start)
        streams[name] = codes.reshape(header.count, size // header.count if header.count else 0)
        start += size
    return streams


def _unpacked_streams(header: _Header, data: bytes, what: str) -> dict[str, np.ndarray]:
    """Return the attributes of version 4."""
    import zstandard

    sizes = header.sizes()
    check_unpacked(what, len(data), sum(sizes.values()))
    # A writer may list a stream of length 0 or leave it out.
    listed = [size for size in sizes.values() if size or header.streams == len(sizes)]
    (at,) = struct.unpack_from("<I", data, _HEADER.size)
    table = np.frombuffer(data, "<u8", 2 * len(listed), at).reshape(-1, 2)
    if len(listed) != header.streams or at < 32 or table[:, 1].tolist() != listed:
        raise DigsError(
            f"{what}: {header.streams} streams, expected {len(listed)} of {listed} bytes"
        )
    at += table.nbytes
    body = b""
    for packed, size in table.tolist():
        # Frames may ask for windows of gigabytes; a window is never longer than what was compressed.
        unpacker = zstandard.ZstdDecompressor(max_window_size=max(size, 1 << 23))
        try:
            piece = unpacker.stream_reader(data[at : at + packed]).read(size + 1) if size else b""
        except zstandard.ZstdError as error:
            raise DigsError(f"{what}: {error}; copy or export the file again") from error
        if len(piece) != size:
            raise DigsError(
                f"{what}: a stream unpacks to other than {size} bytes; truncated or damaged"
            )
        body += piece
        at += packed
    return _split(header, body)


def _decoded(header: _Header, codes: dict[str, np.ndarray]) -> Gaussians:
    """Return Gaussians in the frame of the file."""
    fixed = np.zeros((codes["positions"].size // 3, 4), np.uint8)
    fixed[:, 1:] = codes["positions"].reshape(-1, 3)
    # In the upper three bytes: the shift to the right extends the sign.
    means = (fixed.view("<i4")[:, 0] >> 8) * 2.0**-header.bits
    base = (codes["colors"].astype(np.float64) / 255.0 - 0.5) / COLOR_SCALE
    rest = (codes["sh"].astype(np.float32) - SH_ZERO) / SH_STEPS
    sh = np.concatenate([base.astype(np.float32), rest], axis=1).reshape(len(base), -1, 3)
    return Gaussians(
        means=means.reshape(-1, 3).astype(np.float32),
        log_scales=codes["scales"].astype(np.float32) / LOG_SCALE_STEPS + LOWEST_LOG_SCALE,
        quats=decode_quats(codes["rotations"]),
        opacity_logits=logits_from_codes(codes["alphas"][:, 0]),
        sh=sh[:, : coefficient_count(MAX_DEGREE)],
    )


def decode_quats(codes: np.ndarray) -> np.ndarray:
    """Return quaternions xyzw, (n, 4), float32, of four bytes each (`encode_quats`), or three: x, y and z."""
    if codes.shape[1] == 3:
        xyz = codes.astype(np.float64) / 127.5 - 1.0
        w = np.sqrt(np.maximum(0.0, 1.0 - np.einsum("ni,ni->n", xyz, xyz)))
        return np.column_stack([xyz, w]).astype(np.float32)
    packed = np.ascontiguousarray(codes).view("<u4")[:, 0]
    fields = packed[:, None] >> _SHIFTS
    magnitudes = (fields & _LARGEST_MAGNITUDE) * (_SQRT_HALF / _LARGEST_MAGNITUDE)
    return quats_from_three(packed >> 30, np.where(fields >> 9 & 1, -magnitudes, magnitudes))


def encode_quats(quats: np.ndarray) -> np.ndarray:
    """Return unit quaternions xyzw, (n, 4), as four bytes each, (n, 4), uint8.

    Two bits name the largest component, which is left out and taken as positive; the others follow with
    a sign bit and 9 bits in units of sqrt(1/2) / 511.
    """
    largest, others = smallest_three(quats)
    magnitudes = np.floor(_LARGEST_MAGNITUDE / _SQRT_HALF * np.abs(others) + 0.5).astype(np.uint32)
    fields = (others < 0).astype(np.uint32) << 9 | magnitudes
    packed = largest.astype(np.uint32) << 30 | (fields << _SHIFTS).sum(axis=1, dtype=np.uint32)
    return packed.astype("<u4")[:, None].view(np.uint8)


def write_spz(path: Path, gaussians: Gaussians, sh_bits: tuple[int, int] = SH_BITS) -> None:
    """Write Gaussians of our world (z up); values outside its ranges are clipped, with a warning.

    Args:
        path: the file.
        gaussians: finite values only.
        sh_bits: of the coefficients of band 1, and of the bands above, 1 to 8.

    Raises:
        DigsError: too many Gaussians, or positions beyond 8 million metres.
    """
    what = f"SPZ '{path}'"
    GAUSSIANS.check(what, len(gaussians))
    _warn_of_cuts(gaussians, what)
    splats = turned(gaussians, WORLD_FROM_Y_UP.T)  # with unit quaternions
    bits = _fractional_bits(splats.means, what)
    fixed = np.rint(splats.means.astype(np.float64) * 2.0**bits).astype("<i4")
    rest = splats.sh[:, 1:]
    bucket = np.full((rest.shape[1], 1), 1 << 8 - sh_bits[1])
    bucket[:3] = 1 << 8 - sh_bits[0]
    steps = (rest * np.float32(SH_STEPS) + np.float32(SH_ZERO)) / bucket.astype(np.float32)
    flags = _ANTIALIASED if nearest_known(gaussians.screen_filter).antialias else 0
    parts = (
        _HEADER.pack(MAGIC, VERSION, len(splats), splats.sh_degree, bits, flags, 0),
        fixed.reshape(-1, 1).view(np.uint8)[:, :3],
        codes_from_logits(splats.opacity_logits),
        _to_bytes(255.0 * (COLOR_SCALE * splats.sh[:, 0].astype(np.float64) + 0.5)),
        _to_bytes((splats.log_scales.astype(np.float64) - LOWEST_LOG_SCALE) * LOG_SCALE_STEPS),
        encode_quats(splats.quats.astype(np.float64)),
        _to_bytes(np.rint(steps) * bucket),
    )
    # No name and no time in the gzip header: same input, same bytes.
    packer = zlib.compressobj(_GZIP_LEVEL, zlib.DEFLATED, _GZIP)
    packed = [
        packer.compress(part if isinstance(part, bytes) else part.tobytes()) for part in parts
    ]
    write_atomically(path, b"".join([*packed, packer.flush()]))


def _to_bytes(values: np.ndarray) -> np.ndarray:
    """Return values rounded to the nearest of 0..255."""
    return np.rint(values).clip(0, 255).astype(np.uint8)


def _fractional_bits(positions: np.ndarray, what: str) -> int:
    largest = float(np.abs(positions).max(initial=0.0))
    if largest > _LARGEST_FIXED:
        raise DigsError(
            f"{what}: positions as far as {largest:.3g} m from the origin, the format holds "
            f"{_LARGEST_FIXED:.3g} m; remove the outliers or write PLY"
        )
    return next(
        b for b in range(MOST_FRACTIONAL_BITS, -1, -1) if largest * 2.0**b <= _LARGEST_FIXED
    )


def _warn_of_cuts(gaussians: Gaussians, what: str) -> None:
    """Log how many Gaussians are outside the ranges of the format."""
    thin, lowest = gaussians.log_scales, LOWEST_LOG_SCALE
    for beyond, loss in (
        (thin < lowest, f"are thinner than {np.exp(lowest):.1g} m: thickened"),
        (thin > lowest + 255 / LOG_SCALE_STEPS, "are larger than 380 m: cut"),
        (np.abs(gaussians.sh[:, 0]) > 0.5 / COLOR_SCALE, "have colors far beyond 0..1: cut"),
        (np.abs(gaussians.sh[:, 1:]) > 1.0, "have SH coefficients beyond 1: cut"),
    ):
        if count := np.count_nonzero(beyond.any(axis=tuple(range(1, beyond.ndim)))):
            logger.warning("%s: %d of %d Gaussians %s", what, count, len(gaussians), loss)
