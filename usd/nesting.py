"""Checks how deeply a USD file nests, before the USD library follows it.

The library reads nested brackets, expressions and paths by recursion, so a few hundred kilobytes of
brackets exhaust its stack and end the process. Scenes nest a dozen levels deep. In a crate, its tree of
paths, the expressions in its names and its dictionaries count.
"""

import re
import struct
from collections.abc import Mapping

import numpy as np

from digs_warp.usd.crate import COUNT, Bytes, decompressed, read_count, read_values

# Prims, dictionaries, lists, tuples and the parts of a path may nest this deep. The library gives up at about
# ten thousand in its main thread and earlier in others.
MAX_NESTING = 256

# Brackets in comments mean nothing. Those in strings, asset names and paths may be expressions; each of these
# counts for itself. A piece without an end goes to the end of its line or of the file: no second look at it.
_PIECES = re.compile(
    rb"""
      (?P<comment> \#[^\n]* | //[^\n]* | /\*.*?(?:\*/|\Z) )
    | \"\"\".*?(?:(?<!\\)\"\"\"|\Z) | '''.*?(?:(?<!\\)'''|\Z)
    | "[^"\\\n]*(?:\\.[^"\\\n]*)*"? | '[^'\\\n]*(?:\\.[^'\\\n]*)*'?
    | @@@.*?(?:@@@|\Z) | @[^@\n]*@?
    | <[^>\n]*>?
    """,
    re.VERBOSE | re.DOTALL,
)
_OPEN, _CLOSE = b"([{", b")]}"
_NO_BRACKETS = bytes(set(range(256)) - set(_OPEN + _CLOSE))
_STEPS = np.zeros(256, dtype=np.int64)
_STEPS[list(_OPEN)], _STEPS[list(_CLOSE)] = 1, -1
# Bytes looked at together.
_BATCH = 1 << 20


class NestingError(ValueError):
    """A file that nests too deeply."""


class _Level:
    """The nesting of text that comes in pieces: how deep it is now, and how deep it was at most."""

    def __init__(self) -> None:
        self.deepest = 0
        self._now = 0
        self._waiting = bytearray()

    def add(self, text: bytes) -> None:
        """Go on with the next piece."""
        self._waiting += text.translate(None, _NO_BRACKETS)
        if len(self._waiting) >= _BATCH:
            self.finish()

    def finish(self) -> int:
        """Return the greatest depth of all pieces so far."""
        levels = self._now + np.cumsum(_STEPS[np.frombuffer(self._waiting, dtype=np.uint8)])
        levels -= np.minimum.accumulate(np.minimum(levels, 0))  # nothing lies above the top level
        if len(levels):
            self._now, self.deepest = int(levels[-1]), max(self.deepest, int(levels.max()))
        self._waiting = bytearray()
        return self.deepest


def check_text(data: bytes, what: str) -> None:
    """Check the layer in USD's text format in ``data``.

    Args:
        data: the layer; a view of a mapped file is not copied as a whole.
        what: names it in the message.

    Raises:
        NestingError: brackets, or the parts of a path, are nested deeper than `MAX_NESTING`.
    """
    outside = _Level()
    at = 0
    for piece in _PIECES.finditer(data):
        for start in range(at, piece.start(), _BATCH):
            outside.add(data[start : min(start + _BATCH, piece.start())])
        at = piece.end()
        if not piece["comment"] and at - piece.start() > MAX_NESTING:
            check_word(piece[0], what)
    for start in range(at, len(data), _BATCH):
        outside.add(data[start : start + _BATCH])
    refuse_depth(outside.finish(), "brackets", what)


def check_word(word: bytes, what: str) -> None:
    """Check one string, asset name or path in angle brackets; see `check_text`."""
    inside = _Level()
    inside.add(word)
    refuse_depth(inside.finish(), "brackets in a string", what)
    if word.startswith(b"<"):
        refuse_depth(word.count(b"/"), "a path", what)


def refuse_depth(depth: int, kind: str, what: str) -> None:
    """Raise a `NestingError` when ``kind``, in the file ``what``, nests deeper than `MAX_NESTING`."""
    if depth > MAX_NESTING:
        raise NestingError(f"{kind} nested {depth} deep in {what}, expected up to {MAX_NESTING}")


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
