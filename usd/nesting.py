"""Checks how deeply a USD file nests, before the USD library follows it.

The library reads nested brackets, expressions and paths by recursion, so a few hundred kilobytes of
brackets exhaust its stack and end the process. Scenes nest a dozen levels deep.
"""

import re

import numpy as np

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
