"""The container of SPZ files: header and packed attributes (github.com/nianticlabs/spz, versions 2 to 4).

Versions 2 and 3 are one gzip stream: a header of 16 bytes, then the attributes one after the other.
Version 4 is a header of 32 bytes, perhaps extension records, a table with the lengths of each stream
(compressed, uncompressed), and one Zstandard frame per attribute. All numbers are little-endian.
"""

import logging
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from digs_warp.bounds import GAUSSIANS, check_unpacked
from digs_warp.checks import DigsError, require_file
from digs_warp.record.files import write_atomically

logger = logging.getLogger(__name__)

MAGIC = 0x5053474E  # "NGSP"
VERSIONS = (2, 3, 4)
MAX_DEGREE = 4
FLAG_ANTIALIASED = 1
FLAG_EXTENSIONS = 2

# Attributes in the order of the file, with their bytes per Gaussian; rotation and sh differ.
ATTRIBUTES = ("positions", "alphas", "colors", "scales", "rotations", "sh")

_HEADER = struct.Struct("<IIIBBBB")  # the last byte: reserved; in version 4 the number of streams
_HEADER_4 = struct.Struct("<IIIBBBBI12x")  # ..., where the table of streams begins
_TABLE_ENTRY = struct.Struct("<QQ")

_GZIP_MAGIC = b"\x1f\x8b"
_GZIP_WINDOW = 16 + zlib.MAX_WBITS
# Higher levels take several times as long and save only one or two percent.
GZIP_LEVEL = 3
ZSTD_LEVEL = 3


@dataclass(frozen=True, eq=False)
class PackedSplats:
    """The attributes of ``count`` Gaussians as they are stored: bytes by name of the attribute."""

    version: int
    count: int
    degree: int
    fractional_bits: int
    antialiased: bool
    streams: Mapping[str, bytes | memoryview]


def stream_sizes(version: int, count: int, degree: int) -> dict[str, int]:
    """Return the length [bytes] of each attribute; those without any are not in a version 4 file."""
    per_splat = {
        "positions": 9,
        "alphas": 1,
        "colors": 3,
        "scales": 3,
        "rotations": 3 if version == 2 else 4,
        "sh": 3 * ((degree + 1) ** 2 - 1),
    }
    return {name: count * per_splat[name] for name in ATTRIBUTES}


def read_spz_container(path: Path) -> PackedSplats:
    """Return header and attributes; memory stays in proportion to the size of the file.

    Raises:
        DigsError: not SPZ, another version, truncated or damaged; says what was found and expected.
    """
    what = f"SPZ '{path}'"
    data = require_file(path, "SPZ").read_bytes()
    if data.startswith(_GZIP_MAGIC):
        return _unpack_single(_gunzip(data, what), what)
    magic, version = struct.unpack_from("<II", data) if len(data) >= 8 else (0, 0)
    if magic != MAGIC:
        raise DigsError(
            f"{what}: begins with {data[:4]!r}, expected a gzip stream or b'NGSP'; no SPZ file"
        )
    return _unpack_streams(data, what) if version >= 4 else _unpack_single(data, what)


def write_spz_container(path: Path, packed: PackedSplats) -> None:
    """Write header and attributes in the container of ``packed.version``; same input, same bytes."""
    flags = FLAG_ANTIALIASED if packed.antialiased else 0
    fixed = (MAGIC, packed.version, packed.count, packed.degree, packed.fractional_bits, flags)
    streams = [packed.streams[name] for name in ATTRIBUTES]
    if packed.version < 4:
        # No name and no time in the gzip header.
        packer = zlib.compressobj(GZIP_LEVEL, zlib.DEFLATED, _GZIP_WINDOW)
        parts = [packer.compress(part) for part in (_HEADER.pack(*fixed, 0), *streams)]
        write_atomically(path, b"".join([*parts, packer.flush()]))
        return
    import zstandard

    streams = [stream for stream in streams if stream]
    frames = [zstandard.ZstdCompressor(level=ZSTD_LEVEL).compress(stream) for stream in streams]
    header = _HEADER_4.pack(*fixed, len(frames), _HEADER_4.size)
    table = [
        _TABLE_ENTRY.pack(len(frame), len(stream))
        for frame, stream in zip(frames, streams, strict=True)
    ]
    write_atomically(path, b"".join([header, *table, *frames]))


def _check_header(version: int, count: int, degree: int, bits: int, what: str) -> None:
    if version not in VERSIONS:
        raise DigsError(f"{what}: version {version}, expected one of {VERSIONS}")
    GAUSSIANS.check(what, count)
    if degree > MAX_DEGREE:
        raise DigsError(f"{what}: colors of degree {degree}, expected 0 to {MAX_DEGREE}; damaged")
    if bits > 23:
        raise DigsError(f"{what}: {bits} fractional bits of 24-bit positions, expected 0 to 23")


def _gunzip(data: bytes, what: str) -> bytes:
    """Return the content of a gzip stream: at most what its own header says that it holds."""
    unpacker = zlib.decompressobj(_GZIP_WINDOW)
    try:
        content = unpacker.decompress(data, _HEADER.size)
        if len(content) < _HEADER.size:
            raise DigsError(
                f"{what}: {len(content)} bytes inside, too short for a header; truncated"
            )
        magic, version, count, degree, bits, flags, _ = _HEADER.unpack(content)
        if magic != MAGIC:
            raise DigsError(f"{what}: a gzip file, but without b'NGSP' inside; no SPZ file")
        _check_header(version, count, degree, bits, what)
        needed = sum(stream_sizes(version, count, degree).values())
        check_unpacked(what, len(data), needed)
        rest = unpacker.decompress(unpacker.unconsumed_tail, needed) if needed else b""
    except zlib.error as error:
        raise DigsError(
            f"{what}: damaged gzip stream ({error}); copy or export the file again"
        ) from error
    if len(rest) < needed:
        raise DigsError(
            f"{what}: {count} Gaussians need {needed} bytes, but {len(rest)} are inside; truncated or "
            "damaged, copy or export it again"
        )
    _check_checksum(unpacker, flags, what)
    return content + rest


def _check_checksum(unpacker: "zlib._Decompress", flags: int, what: str) -> None:
    """Read to the end of the gzip stream, where its checksum is; extension records may come before."""
    try:
        while not unpacker.eof:
            # One byte at a time would do: gzip checks the sum when it has given out the last one.
            surplus = unpacker.decompress(unpacker.unconsumed_tail, 1 << 16)
            if surplus and not flags & FLAG_EXTENSIONS:
                raise DigsError(
                    f"{what}: more bytes inside than its header promises; damaged, export it again"
                )
            if not surplus and not unpacker.eof:
                raise DigsError(
                    f"{what}: the gzip stream breaks off; copy or export the file again"
                )
    except zlib.error as error:
        raise DigsError(
            f"{what}: damaged gzip stream ({error}); copy or export the file again"
        ) from error


def _unpack_single(data: bytes, what: str) -> PackedSplats:
    """Split the content of a version 2 or 3 file."""
    if len(data) < _HEADER.size:
        raise DigsError(f"{what}: {len(data)} bytes, too short for a header; truncated")
    _, version, count, degree, bits, flags, _ = _HEADER.unpack_from(data)
    _check_header(version, count, degree, bits, what)
    if version > 3:
        raise DigsError(f"{what}: version {version} in a gzip stream, expected 2 or 3; damaged")
    _warn_of_extensions(flags, what)
    sizes = stream_sizes(version, count, degree)
    needed = _HEADER.size + sum(sizes.values())
    if len(data) < needed or (len(data) > needed and not flags & FLAG_EXTENSIONS):
        raise DigsError(
            f"{what}: {count} Gaussians need {needed} bytes, found {len(data)}; truncated or damaged, "
            "copy or export it again"
        )
    streams, start = {}, _HEADER.size
    for name, size in sizes.items():
        streams[name] = memoryview(data)[start : start + size]
        start += size
    return PackedSplats(version, count, degree, bits, bool(flags & FLAG_ANTIALIASED), streams)


def _unpack_streams(data: bytes, what: str) -> PackedSplats:
    """Split a version 4 file and unpack its streams."""
    if len(data) < _HEADER_4.size:
        raise DigsError(f"{what}: {len(data)} bytes, too short for a header; truncated")
    _, version, count, degree, bits, flags, found, table_start = _HEADER_4.unpack_from(data)
    _check_header(version, count, degree, bits, what)
    _warn_of_extensions(flags, what)
    sizes = {name: size for name, size in stream_sizes(version, count, degree).items() if size}
    # A writer may list a stream of length 0 or leave it out.
    if found not in (len(sizes), len(ATTRIBUTES)):
        raise DigsError(f"{what}: {found} streams, expected {len(sizes)}; damaged")
    if found == len(ATTRIBUTES):
        sizes = stream_sizes(version, count, degree)
    start = table_start + found * _TABLE_ENTRY.size
    if table_start < _HEADER_4.size or start > len(data):
        raise DigsError(f"{what}: the table of streams is outside the file; truncated or damaged")
    check_unpacked(what, len(data), sum(sizes.values()))
    streams: dict[str, bytes | memoryview] = dict.fromkeys(ATTRIBUTES, b"")
    for number, (name, size) in enumerate(sizes.items()):
        packed, unpacked = _TABLE_ENTRY.unpack_from(data, table_start + number * _TABLE_ENTRY.size)
        if unpacked != size or start + packed > len(data):
            raise DigsError(
                f"{what}: {name} of {packed} bytes for {unpacked}, expected {size} for {count} "
                f"Gaussians and {len(data) - start} left in the file; truncated or damaged"
            )
        streams[name] = _unzstd(data[start : start + packed], size, f"{what}, {name}")
        start += packed
    return PackedSplats(version, count, degree, bits, bool(flags & FLAG_ANTIALIASED), streams)


def _unzstd(frame: bytes, size: int, what: str) -> bytes:
    """Return the content of a Zstandard frame, ignoring the length that the frame claims."""
    if not size:
        return b""
    import zstandard

    # Frames may ask for windows of gigabytes; a window is never longer than what was compressed.
    window = max(1 << 10, 1 << (size - 1).bit_length())
    try:
        reader = zstandard.ZstdDecompressor(max_window_size=max(window, 1 << 23)).stream_reader(
            frame
        )
        content = reader.read(size + 1)
    except zstandard.ZstdError as error:
        raise DigsError(f"{what}: {error}; copy or export the file again") from error
    if len(content) != size:
        raise DigsError(
            f"{what}: the stream unpacks to {'more' if len(content) > size else len(content)} bytes, "
            f"expected {size}; truncated or damaged, copy or export it again"
        )
    return content


def _warn_of_extensions(flags: int, what: str) -> None:
    if flags & FLAG_EXTENSIONS:
        logger.warning("%s: extension records of other programs are skipped", what)
