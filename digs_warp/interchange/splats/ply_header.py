"""The header of a PLY file (Turk 1994), read with suspicion: it may promise anything."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, require_file

# A Gaussian has about 62 properties of 30 characters; mesh headers with comments stay far below this.
MAX_HEADER_BYTES = 1 << 16

LONGEST_COUNT = 18  # digits

ASCII = "ascii"
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}

# PLY's names of number types, the old and the new ones -> NumPy's.
_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}


@dataclass(frozen=True)
class PlyElement:
    """A table of the file: its name, its rows, and the NumPy type of each column by name.

    A column of lists (the corners of a face) has the type "list".
    """

    name: str
    count: int
    columns: dict[str, str]

    @property
    def has_lists(self) -> bool:
        """Whether rows have no fixed length."""
        return "list" in self.columns.values()

    def row_type(self, byte_order: str) -> np.dtype:
        """Return the type of a row in a binary file; only without lists."""
        return np.dtype([(name, byte_order + kind) for name, kind in self.columns.items()])


@dataclass(frozen=True)
class PlyHeader:
    """What a header says.

    Attributes:
        encoding: "ascii" or a key of `BYTE_ORDERS`.
        elements: the tables in the order in which their data follows.
        data_start: where the data begins [bytes].
    """

    encoding: str
    elements: tuple[PlyElement, ...]
    data_start: int


def read_ply_header(path: Path) -> PlyHeader:
    """Return the header of a PLY file.

    Raises:
        DigsError: not a PLY file, or a header that is cut off, too long or malformed; names the line.
    """
    what = f"PLY '{path}'"
    require_file(path, "PLY")
    with Path(path).open("rb") as file:
        start = file.read(MAX_HEADER_BYTES)
    if not start.startswith((b"ply\n", b"ply\r")):
        raise DigsError(f"{what}: not a PLY file: it begins with {start[:8]!r}, expected b'ply'")
    lines = start.splitlines(keepends=True)
    end = next((i for i, line in enumerate(lines) if line.strip() == b"end_header"), None)
    if end is None or not lines[end].endswith(b"\n"):
        raise DigsError(
            f"{what}: no 'end_header' in the first {len(start)} bytes; truncated, or no PLY file"
        )
    data_start = sum(len(line) for line in lines[: end + 1])
    encoding, elements = "", []
    for number, line in enumerate(lines[1:end], start=2):
        words = line.decode("latin-1").split()
        where = f"{what}, header line {number}"
        match words:
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, "1.0"] if name == ASCII or name in BYTE_ORDERS:
                encoding = name
            case ["element", name, count]:
                elements.append(PlyElement(name, _count(count, where), {}))
            case ["property", "list", _, _, name] if elements:
                _add_column(elements[-1], name, "list", where)
            case ["property", kind, name] if elements and kind in _TYPES:
                _add_column(elements[-1], name, _TYPES[kind], where)
            case _:
                raise DigsError(f"{where}: cannot be understood: '{' '.join(words)[:60]}'")
    if not encoding:
        raise DigsError(f"{what}: the header has no 'format' line; truncated or damaged")
    return PlyHeader(encoding, tuple(elements), data_start)


def _count(text: str, where: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= LONGEST_COUNT):
        raise DigsError(f"{where}: '{text[:30]}' rows, expected a whole number")
    return int(text)


def _add_column(element: PlyElement, name: str, kind: str, where: str) -> None:
    if name in element.columns:
        raise DigsError(f"{where}: the property '{name}' occurs twice")
    element.columns[name] = kind
