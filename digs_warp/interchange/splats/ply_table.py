"""The rows of one table of a PLY file, binary or text; never more memory than the file is long."""

from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.interchange.splats.ply_header import ASCII, BYTE_ORDERS, PlyElement, PlyHeader

# Lines of a text file parsed at a time: the words of 62 columns take some ten megabytes.
LINES_AT_A_TIME = 4096


def read_table(path: Path, header: PlyHeader, name: str) -> np.ndarray:
    """Return the rows of the element ``name``, a structured array with a field per property, shape (n,).

    Raises:
        DigsError: there is no such element, it has lists, or the file holds fewer or more bytes than its
            header promises.
    """
    names = [element.name for element in header.elements]
    what = f"PLY '{path}'"
    if name not in names:
        raise DigsError(f"{what}: no '{name}' element; found {', '.join(names) or 'none'}")
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
    values = np.empty((element.count, columns))
    with Path(path).open("rb") as file:
        file.seek(header.data_start)
        for _ in range(sum(table.count for table in before)):
            if not file.readline():
                break
        for first in range(0, element.count, LINES_AT_A_TIME):
            last = min(first + LINES_AT_A_TIME, element.count)
            rows = [file.readline().split() for _ in range(first, last)]
            try:
                values[first:last] = np.array(rows, dtype=np.float64).reshape(-1, columns)
            except ValueError as error:
                raise DigsError(
                    f"{what}, rows {first} to {last - 1}: {error}; expected {columns} numbers in each; "
                    "truncated or damaged, copy or export it again"
                ) from error
    return _structured(values, element)


def _structured(values: np.ndarray, element: PlyElement) -> np.ndarray:
    """Return rows of float64 as the structured array that a binary file would give."""
    kind = element.row_type("<")
    table = np.empty(len(values), dtype=kind)
    with np.errstate(over="ignore", invalid="ignore"):  # found by the check of the rows
        for number, name in enumerate(kind.names or ()):
            table[name] = values[:, number]
    return table
