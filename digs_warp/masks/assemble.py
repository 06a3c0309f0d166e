"""Puts a network file together from the parts that it is distributed in, and checks them.

Parts named by their SHA-256, as packages of background removers for browsers have them, are checked one by
one. An index file (.json) says their order: `{"NAME": {"chunks": [{"hash": ...}, ...], "size": ...}}`.
"""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.masks.network import MODEL_FILE, MaskNetwork
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json, write_atomically

# The MD5 that rembg publishes for its isnet-general-use.onnx.
REMBG_MD5 = "fc16ebd8b0c10d971d3513d564d01e29"

SUM = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class Assembled:
    """A network file that was written.

    Attributes:
        size: bytes.
        sha256: of the file.
        checked_by: what says that it is the right file, in words; None: nothing does.
    """

    size: int
    sha256: str
    checked_by: str | None


def assemble(files: Sequence[Path], out: Path, sha256: str | None = None) -> Assembled:
    """Write the network that the parts make.

    Args:
        files: the parts in their order, or in any order with an index file among them.
        out: the file to write.
        sha256: what the sum of the result has to be.

    Raises:
        DigsError: a part is missing or damaged, a sum differs, or the result is no mask network.
    """
    for file in files:
        require_file(file, "part of a network", "Name the files that you have downloaded")
    parts, size = _in_order(files)
    data = b"".join(_checked(part) for part in parts)
    if size is not None and len(data) != size:
        raise DigsError(
            f"masks assemble: the parts have {len(data):,} bytes together, but the index says {size:,}; "
            "download them again"
        )
    found = hashlib.sha256(data).hexdigest()
    if sha256 is not None and found != sha256.lower():
        raise DigsError(
            f"masks assemble: the SHA-256 of the result is {found}, expected {sha256}; check the order of "
            "the parts, or download them again"
        )
    _require_mask_network(data)
    write_atomically(out, data)
    return Assembled(len(data), found, _checked_by(data, parts, sha256))


def _in_order(files: Sequence[Path]) -> tuple[list[Path], int | None]:
    """Return the parts in their order, and the size that an index file gives the result."""
    parts = [file for file in files if file.suffix.lower() != ".json"]
    indices = [file for file in files if file.suffix.lower() == ".json"]
    if len(indices) > 1 or not parts:
        raise DigsError(
            f"masks assemble: {len(parts)} parts and {len(indices)} index files (.json), expected parts and "
            "at most one index"
        )
    if not indices:
        return parts, None
    by_name = {part.name: part for part in parts}
    missing: list[str] = []
    content = Fields(read_json(indices[0], "index of the parts"), f"'{indices[0]}'")
    for name in content.values:
        entry = content.section(name)
        names = [chunk.text("hash") for chunk in entry.sections("chunks")]
        if names and set(names) == by_name.keys():
            return [by_name[each] for each in names], entry.whole("size", 1)
        if by_name.keys() & set(names):
            missing += sorted(set(names) - by_name.keys())
    lacking = f"; {len(missing)} are missing, the first is '{missing[0]}'" if missing else ""
    raise DigsError(
        f"masks assemble: no entry of '{indices[0]}' consists of these {len(parts)} parts{lacking}. Name all "
        "parts of one network"
    )


def _checked(part: Path) -> bytes:
    """Return the bytes of a part; one that is named by its SHA-256 must have it."""
    data = part.read_bytes()
    if SUM.fullmatch(part.name) and hashlib.sha256(data).hexdigest() != part.name:
        raise DigsError(
            f"part of a network '{part}': damaged, its SHA-256 is not its name; download it again"
        )
    return data


def _checked_by(data: bytes, parts: Sequence[Path], sha256: str | None) -> str | None:
    if hashlib.md5(data, usedforsecurity=False).hexdigest() == REMBG_MD5:
        return f"the MD5 that rembg publishes for {MODEL_FILE}"
    if sha256 is not None:
        return "--sha256"
    return (
        "the sums in the names of its parts" if all(SUM.fullmatch(p.name) for p in parts) else None
    )


def _require_mask_network(data: bytes) -> None:
    with TemporaryDirectory(prefix="digs-warp-") as scratch:
        path = Path(scratch) / MODEL_FILE
        write_atomically(path, data)
        MaskNetwork(path, threads=1).mask(np.zeros((8, 8, 3), np.uint8))
