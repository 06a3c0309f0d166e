"""Image files as bytes in memory, encoded by OpenImageIO and checked to be complete.

Written to a disk that is full, OpenImageIO reports success for a truncated PNG. In memory there is room, and
the bytes then go through `digs_warp.record.files`, which checks each write.
"""

import os
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError

_PNG_END = bytes.fromhex("0000000049454e44ae426082")

# Of OpenEXR: magic number and version, before the attributes; first line and size of a chunk, before its
# pixels.
_EXR_START = 8
_EXR_CHUNK = struct.Struct("<ii")


def encode(form: str, spec: Any, pixels: np.ndarray) -> bytes:
    """Return an image file.

    Args:
        form: "png" or "exr".
        spec: the `OpenImageIO.ImageSpec`.
        pixels: shape (height, width, channels), as ``spec`` says.

    Raises:
        DigsError: the format cannot hold the pixels, or the file comes out incomplete.
    """
    import OpenImageIO as oiio

    with _memory_file(form) as path:
        target = oiio.ImageOutput.create(form)
        if target is None or not target.open(str(path), spec):
            raise DigsError(f"cannot be written ({oiio.geterror()})")
        written = target.write_image(pixels)
        closed = target.close()
        problem = target.geterror()
        data = path.read_bytes()
    if not (written and closed) or problem:
        raise DigsError(f"cannot be written ({problem.strip()})")
    if not (data.endswith(_PNG_END) if form == "png" else _is_complete_exr(data)):
        raise DigsError(
            f"cannot be written: its {len(data)} bytes are not complete. Is there a limit on the size of "
            "files (ulimit -f), or too little memory?"
        )
    return data


@contextmanager
def _memory_file(form: str) -> Iterator[Path]:
    """Give the name of an empty file in memory; where the system has none, of a temporary file."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create(form)
        try:
            yield Path(f"/proc/self/fd/{descriptor}")
        finally:
            os.close(descriptor)
    else:
        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder) / f"image.{form}"


def _is_complete_exr(data: bytes) -> bool:
    """Whether the last chunk of an OpenEXR file with lines of pixels ends where the file ends."""
    at = _EXR_START
    try:
        while data[at]:  # an attribute: name, type, size, value
            at = data.index(0, data.index(0, at) + 1) + 1
            at += 4 + int.from_bytes(data[at : at + 4], "little")
        first = int.from_bytes(data[at + 1 : at + 9], "little")
        table = np.frombuffer(data[at + 1 : first], "<u8")
        last = int(table.max())
        return last + _EXR_CHUNK.size + _EXR_CHUNK.unpack_from(data, last)[1] == len(data)
    except (IndexError, ValueError, struct.error):
        return False
