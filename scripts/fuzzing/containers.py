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


_OPENERS: dict[str, Callable[[bytes, random.Random], Container]] = {
    ".glb": _open_glb,
    ".spz": _open_gzip,
    ".npz": lambda data, rng: _open_zip(data, rng, _npz),
    ".usdz": lambda data, rng: _open_zip(data, rng, _usdz),
}
