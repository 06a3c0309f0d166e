"""How deeply a crate nests: its tree of paths, the expressions in its names, its dictionaries.

The USD library follows each by recursion. See `digs_warp.usd.nesting`.
"""

import struct
from collections.abc import Mapping

import numpy as np

from digs_warp.usd.crate import COUNT, Bytes, decompressed, read_count, read_values
from digs_warp.usd.nesting import MAX_NESTING, check_word, refuse_depth

# Names and strings of all prims together [bytes]; a large scene has one or two million.
MAX_TOKENS = 1 << 26
# Entries of all dictionaries; the metadata of a scene have hundreds.
MAX_ENTRIES = 1 << 20

# A value has 64 bits: whether it is stored here (an empty dictionary), its type, or its place in the file.
_IS_INLINED, _TYPE, _PLACE = 1 << 62, 255 << 48, (1 << 48) - 1
_DICTIONARY = 31 << 48
# An entry: the number of its name, and how far ahead its value is, counted from this second number. What the
# value holds comes before it, the next entry behind it.
_ENTRY = struct.Struct("<Iq")
_OFFSET_IN_ENTRY = 4


def check_crate_nesting(
    data: Bytes, what: str, start: int, size: int, bodies: Mapping[str, bytes]
) -> None:
    """Check the names and dictionaries of the crate in ``data[start : start + size]``.

    Args:
        data: the file.
        what: names the crate in messages.
        start: where it begins.
        size: its length [bytes].
        bodies: its sections by name.

    Raises:
        ValueError: brackets in a name, or dictionaries, are nested too deeply, or there are too many.
    """
    _check_words(bodies["TOKENS"], what)
    if "FIELDS" in bodies:
        _, values = read_values(bodies["FIELDS"], what)
        _check_dictionaries(data, what, start, size, values.tolist())


def check_tree_depth(jumps: np.ndarray, what: str) -> None:
    """Check the tree of paths of a crate; ``jumps`` as in `digs_warp.usd.structure.check_paths`."""
    waiting: list[int] = []  # the levels of siblings still to come
    level = deepest = 0
    for jump in jumps.tolist():
        deepest = max(deepest, level)
        if jump > 0:
            waiting.append(level)
        if jump > 0 or jump == -1:
            level += 1
        elif jump == -2 and waiting:
            level = waiting.pop()
    refuse_depth(deepest, "prims", what)


def _check_words(tokens: bytes, what: str) -> None:
    """Check the section TOKENS: a count, a length, and one compressed block of all names and strings."""
    size = read_count(tokens, COUNT.size, what)
    if size > MAX_TOKENS:
        raise ValueError(f"{what} claims {size} bytes of names, expected up to {MAX_TOKENS}")
    for word in decompressed(tokens[3 * COUNT.size :], size).split(b"\0"):
        if len(word) > MAX_NESTING:
            check_word(word, what)


def _check_dictionaries(data: Bytes, what: str, start: int, size: int, values: list[int]) -> None:
    end = start + size
    waiting = [(value, 1) for value in values if _is_dictionary(value)]
    entries = 0
    while waiting:
        value, depth = waiting.pop()
        refuse_depth(depth, "dictionaries", what)
        at = start + (value & _PLACE)
        count = read_count(data[at : at + COUNT.size], 0, what)
        entries += count
        if entries > MAX_ENTRIES:
            raise ValueError(f"dictionaries of more than {MAX_ENTRIES} entries in {what}")
        at += COUNT.size
        for _ in range(count):
            if at + _ENTRY.size > end:
                raise ValueError(f"a dictionary of {what} is cut off")
            _, offset = _ENTRY.unpack(data[at : at + _ENTRY.size])
            at += _OFFSET_IN_ENTRY + offset
            if not start <= at <= end - COUNT.size:
                raise ValueError(f"a dictionary of {what} leads out of the file")
            value = read_count(data[at : at + COUNT.size], 0, what)
            at += COUNT.size
            if _is_dictionary(value):
                waiting.append((value, depth + 1))


def _is_dictionary(value: int) -> bool:
    return value & (_IS_INLINED | _TYPE) == _DICTIONARY
