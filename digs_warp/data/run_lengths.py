"""A mask as lengths of runs, in the compressed text of COCO, which BOP's toolkit and pycocotools read.

The pixels are taken column by column. The runs alternate between 0 and 1, starting with 0; from the fourth
one on, a run is stored as the difference to the one before the last. Five bits of a number make a character,
the lowest ones first; a sixth bit says that more follow. See
https://github.com/cocodataset/cocoapi/blob/master/common/maskApi.c.
"""

import numpy as np

FIRST_CHARACTER = 48  # "0"
BITS, MORE, SIGN = 5, 0x20, 0x10


def text_of_mask(mask: np.ndarray) -> str:
    """Return the runs of a mask, (height, width), bool."""
    pixels = np.asarray(mask, bool).ravel(order="F")
    starts = np.flatnonzero(np.diff(pixels, prepend=False))
    runs = np.diff(starts, prepend=0, append=pixels.size).tolist()
    return "".join(_text(run - (runs[i - 2] if i > 2 else 0)) for i, run in enumerate(runs))


def mask_of_text(text: str, height: int, width: int) -> np.ndarray:
    """Return the mask, (height, width), bool.

    Raises:
        ValueError: the text is no list of runs, or belongs to a mask of another size.
    """
    runs: list[int] = []
    for number in _numbers(text):
        runs.append(number + (runs[-2] if len(runs) > 2 else 0))
    if min(runs, default=-1) < 0 or sum(runs) != height * width:
        raise ValueError(f"runs of {sum(runs)} pixels, expected {height * width}")
    values = np.arange(len(runs)) % 2 == 1
    return np.repeat(values, runs).reshape((height, width), order="F")


def _text(number: int) -> str:
    characters = []
    while True:
        low, number = number & (MORE - 1), number >> BITS
        ends = number == (-1 if low & SIGN else 0)
        characters.append(chr(FIRST_CHARACTER + low + (0 if ends else MORE)))
        if ends:
            return "".join(characters)


def _numbers(text: str) -> list[int]:
    numbers, value, shift = [], 0, 0
    for character in text:
        code = ord(character) - FIRST_CHARACTER
        if not 0 <= code < 2 * MORE:
            raise ValueError(f"'{character}' is no character of runs")
        value |= (code & (MORE - 1)) << shift
        shift += BITS
        if not code & MORE:
            numbers.append(value - (1 << shift) if code & SIGN else value)
            value = shift = 0
    if shift:
        raise ValueError("the text ends within a number")
    return numbers
