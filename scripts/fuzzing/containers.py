"""Files whose content is packed or has checksums: opened, so that faults can be made inside them."""

import gzip
import io
import random
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from digs_warp.usd.files import write_package

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
BROKEN = (ValueError, IndexError, OSError, struct.error, zipfile.BadZipFile, zlib.error, EOFError)


@dataclass(frozen=True)
class Container:
    """A part of a file, and how the file is put together again around another part.

    Attributes:
        name: of the part; its suffix says what it holds.
        content: of the part.
        pack: returns the file with another content.
    """

    name: str
    content: bytes
    pack: Callable[[bytes], bytes]


def open_container(name: str, data: bytes, rng: random.Random) -> Container | None:
    """Return one part of a file; None for files without parts, and for those that are broken already."""
    opener = _OPENERS.get(Path(name).suffix.lower())
    try:
        return opener(data, rng) if opener else None
    except BROKEN:
        return None


def _open_glb(data: bytes, rng: random.Random) -> Container:
    """The JSON chunk or the binary one."""
    length = struct.unpack_from("<I", data, 12)[0]
    text, rest = data[20 : 20 + length], data[20 + length :]
    header, body = rest[:8], rest[8:]

    def glb(text: bytes, body: bytes) -> bytes:
        text += b" " * (-len(text) % 4)
        body += b"\0" * (-len(body) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(body), header[4:8]) + body
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    if rng.random() < 0.8:
        return Container("chunk.json", text, lambda new: glb(new, body))
    return Container("chunk.bin", body, lambda new: glb(text, new))


def _open_gzip(data: bytes, rng: random.Random) -> Container:
    return Container("payload.bin", gzip.decompress(data), lambda new: gzip.compress(new, mtime=0))


def _open_zip(
    data: bytes, rng: random.Random, packed: Callable[[Mapping[str, bytes]], bytes]
) -> Container:
    """One member; ``packed`` puts members together."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    chosen = rng.choice(sorted(members))
    return Container(chosen, members[chosen], lambda new: packed(members | {chosen: new}))


def _npz(members: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def _usdz(members: Mapping[str, bytes]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "scene.usdz")
        for name, content in members.items():
            Path(folder, name).write_bytes(content)
        write_package(target, [Path(folder, name) for name in members], target)
        return target.read_bytes()


def _open_png(data: bytes, rng: random.Random) -> Container:
    """One chunk with the right checksum, half of the time that with the size."""
    chunks, at = [], len(PNG_SIGNATURE)
    while at < len(data):
        length = struct.unpack_from(">I", data, at)[0]
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    chosen = 0 if rng.random() < 0.5 else rng.randrange(len(chunks))

    def packed(new: bytes) -> bytes:
        file = PNG_SIGNATURE
        for number, (kind, old) in enumerate(chunks):
            content = new if number == chosen else old
            file += struct.pack(">I", len(content)) + kind + content
            file += struct.pack(">I", zlib.crc32(kind + content))
        return file

    return Container("chunk.bin", chunks[chosen][1], packed)


def _open_npy(data: bytes, rng: random.Random) -> Container:
    """The header of an array, with the right length."""
    length = struct.unpack_from("<H", data, 8)[0]
    header, values = data[10 : 10 + length], data[10 + length :]

    def packed(new: bytes) -> bytes:
        return data[:8] + struct.pack("<H", len(new) % 2**16) + new + values

    return Container("header.txt", header.rstrip() + b"\n", packed)


_OPENERS: dict[str, Callable[[bytes, random.Random], Container]] = {
    ".glb": _open_glb,
    ".spz": _open_gzip,
    ".npz": lambda data, rng: _open_zip(data, rng, _npz),
    ".npy": _open_npy,
    ".usdz": lambda data, rng: _open_zip(data, rng, _usdz),
    ".png": _open_png,
}
