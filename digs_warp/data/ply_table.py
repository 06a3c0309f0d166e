"""A PLY file (Turk 1994) as tables. Its header may promise anything; memory stays below the file's size."""

import codecs
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.record.files import write_atomically
from digs_warp.words import cut, first_few, quoted

# A Gaussian has about 62 properties of 30 characters; mesh headers with comments stay far below this.
MAX_HEADER_BYTES = 1 << 16

LONGEST_COUNT = 18  # digits

ASCII = "ascii"
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}

# NumPy's number types -> PLY's names of them: the old ones, which every program knows.
_NAMES = {
    **{"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort"},
    **{"i4": "int", "u4": "uint", "f4": "float", "f8": "double"},
}
_TYPES = {
    **{name: kind for kind, name in _NAMES.items()},
    **{np.dtype(kind).name: kind for kind in _NAMES},
}
# What scanners of the nineties, and a few programs, call colors.
USUAL_NAMES = {
    name: color
    for color in ("red", "green", "blue")
    for name in (f"diffuse_{color}", color[0], color.capitalize())
}


@dataclass(frozen=True)
class PlyElement:
    """A table of the file: its name, its rows, and the NumPy type of each column by name.

    A column of lists (the corners of a face) has the types of their lengths and items, such as "u1 i4".
    """

    name: str
    count: int
    columns: dict[str, str]

    @property
    def has_lists(self) -> bool:
        """Whether rows have no fixed length."""
        return any(" " in kind for kind in self.columns.values())

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
        comments: its comments, without the word "comment".
    """

    encoding: str
    elements: tuple[PlyElement, ...]
    data_start: int
    comments: tuple[str, ...] = ()

    @property
    def holds_splats(self) -> bool:
        """Whether it has what neither meshes nor point clouds have: colors of Gaussians, maybe compressed."""
        return any({"f_dc_0", "packed_position"} & each.columns.keys() for each in self.elements)


def read_ply_header(path: Path) -> PlyHeader:
    """Return the header of a PLY file.

    Raises:
        DigsError: not a PLY file, or a header that is cut off, too long or malformed; names the line.
    """
    what = f"PLY '{path}'"
    require_file(path, "PLY")
    with Path(path).open("rb") as file:
        start = file.read(MAX_HEADER_BYTES)
    mark = len(start) - len(start := start.removeprefix(codecs.BOM_UTF8))
    if not start.startswith((b"ply\n", b"ply\r")):
        raise DigsError(f"{what}: not a PLY file: it begins with {start[:8]!r}, expected b'ply'")
    lines = start.splitlines(keepends=True)
    end = next((i for i, line in enumerate(lines) if line.strip() == b"end_header"), None)
    if end is None or not lines[end].endswith(b"\n"):
        raise DigsError(
            f"{what}: no 'end_header' in the first {len(start)} bytes; truncated, or no PLY file"
        )
    data_start = mark + sum(len(line) for line in lines[: end + 1])
    encoding, elements, comments, kinds = "", [], [], _TYPES.keys()
    for number, line in enumerate(lines[1:end], start=2):
        words = line.decode("latin-1").split()
        where = f"{what}, header line {number}"
        match words:
            case ["comment", *said]:
                comments.append(" ".join(said))
            case [] | ["obj_info", *_]:
                pass
            case ["format", name, "1.0"] if name == ASCII or name in BYTE_ORDERS:
                encoding = name
            case ["element", name, count]:
                elements.append(PlyElement(name, _count(count, where), {}))
            case ["property", "list", length, kind, name] if elements and {length, kind} <= kinds:
                _add_column(elements[-1], name, f"{_TYPES[length]} {_TYPES[kind]}", where)
            case ["property", kind, name] if elements and kind in kinds:
                _add_column(elements[-1], USUAL_NAMES.get(name, name), _TYPES[kind], where)
            case _:
                raise DigsError(f"{where}: cannot be understood: {quoted(' '.join(words))}")
    if not encoding:
        raise DigsError(f"{what}: the header has no 'format' line; truncated or damaged")
    return PlyHeader(encoding, tuple(elements), data_start, tuple(comments))


def _count(text: str, where: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= LONGEST_COUNT):
        raise DigsError(f"{where}: {quoted(text)} rows, expected a whole number")
    return int(text)


def _add_column(element: PlyElement, name: str, kind: str, where: str) -> None:
    if name in element.columns:
        raise DigsError(f"{where}: the property {quoted(name)} occurs twice")
    element.columns[name] = kind


def write_tables(
    path: Path, tables: Mapping[str, np.ndarray], comments: Sequence[str] = ()
) -> None:
    """Write structured arrays, shape (n,), as the elements of a binary file; see `write_atomically`.

    Args:
        path: the file.
        tables: by name of the element; fields of little-endian numbers, without gaps, whose names become
            those of the properties.
        comments: for the header, a line each.
    """
    header = ["ply", "format binary_little_endian 1.0"]
    for element, table in tables.items():
        header.append(f"element {element} {len(table)}")
        for name in table.dtype.names or ():
            header.append(f"property {_NAMES[table.dtype[name].str[1:]]} {name}")
    # At the end: the SIBR viewer expects the number of rows in the third line.
    header += [f"comment {each}" for each in comments]
    data = [table.tobytes() for table in tables.values()]
    write_atomically(path, b"".join(["\n".join([*header, "end_header", ""]).encode(), *data]))


def read_table(path: Path, header: PlyHeader, name: str) -> np.ndarray:
    """Return the rows of the element ``name``, a structured array with a field per property, shape (n,).

    Raises:
        DigsError: there is no such element, it has lists, or the file holds fewer or more bytes than its
            header promises.
    """
    names = [element.name for element in header.elements]
    what = f"PLY '{path}'"
    if name not in names:
        raise DigsError(
            f"{what}: no '{name}' element; found {first_few([*map(cut, names)]) or 'none'}"
        )
    number = names.index(name)
    before, element = header.elements[:number], header.elements[number]
    for table in (*before, element):
        if table.has_lists:
            raise DigsError(
                f"{what}: the element '{table.name}' holds lists, expected numbers only"
            )
    if not element.columns:
        raise DigsError(f"{what}: the element '{name}' has no properties; damaged")
    is_last = number == len(names) - 1
    if header.encoding == ASCII:
        return _read_text(path, header, before, element)
    byte_order = BYTE_ORDERS[header.encoding]
    start = header.data_start
    start += sum(table.count * table.row_type(byte_order).itemsize for table in before)
    kind = element.row_type(byte_order)
    held = Path(path).stat().st_size - start
    needed = element.count * kind.itemsize
    if held < needed or (is_last and held >= needed + max(kind.itemsize, 1)):
        raise DigsError(
            f"{what}: {element.count} rows of {kind.itemsize} bytes need {needed} bytes, but "
            f"{max(held, 0)} follow the header; truncated or damaged, copy or export it again"
        )
    return np.fromfile(path, dtype=kind, count=element.count, offset=start)


def _read_text(
    path: Path, header: PlyHeader, before: tuple[PlyElement, ...], element: PlyElement
) -> np.ndarray:
    what = f"PLY '{path}'"
    columns = len(element.columns)
    # A row takes at least a digit and a separator per column: promises beyond are found out here.
    if 2 * element.count * columns > Path(path).stat().st_size - header.data_start + 1:
        raise DigsError(
            f"{what}: {element.count} rows of {columns} numbers do not fit into the file; "
            "truncated or damaged, copy or export it again"
        )
    skipped = sum(table.count for table in before)
    with Path(path).open("rb") as file:
        file.seek(header.data_start)
        try:
            values = np.loadtxt(
                file, comments=None, skiprows=skipped, max_rows=element.count, ndmin=2
            ).reshape(element.count, columns)
        except ValueError as error:
            raise DigsError(
                f"{what}, rows of '{element.name}': {error}; expected {columns} numbers in each; "
                "truncated or damaged, copy or export it again"
            ) from error
    kind = element.row_type("<")
    table = np.empty(len(values), dtype=kind)
    with np.errstate(over="ignore", invalid="ignore"):  # found by the check of the rows
        for number, name in enumerate(kind.names or ()):
            table[name] = values[:, number]
    return table
