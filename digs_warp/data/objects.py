"""The objects of a simulated recording and how its frames see them, as transforms.json holds both."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from digs_warp.record.typed import COUNT, Expect

# Rows of numbers; a tuple, so that facts can be compared.
Matrix = tuple[tuple[float, ...], ...]

# By how much the axes of a placement may miss equal lengths and right angles.
SIMILARITY_TOLERANCE = 1e-6


def matrix_rows(matrix: np.ndarray) -> Matrix:
    """Return a matrix in a form that can be compared."""
    return tuple(map(tuple, matrix.tolist()))


def _is_placement(rows: Matrix) -> bool:
    """Whether it is a rotation, a scale and a translation, (4, 4)."""
    if [len(row) for row in rows] != [4] * 4 or rows[3] != (0.0, 0.0, 0.0, 1.0):
        return False
    linear = np.array(rows, np.float64)[:3, :3]
    volume = np.linalg.det(linear)
    axes = linear / np.cbrt(volume) if volume > 0 else np.zeros((3, 3))
    return bool(np.abs(axes @ axes.T - np.eye(3)).max() < SIMILARITY_TOLERANCE)


PLACEMENT = Expect("4 rows of 4 numbers: a rotation, a scale and a translation", _is_placement)
SIDES = Expect("3 lengths in metres", lambda sides: min(sides) >= 0)


@dataclass(frozen=True)
class PlacedObject:
    """An object of a recording.

    Attributes:
        name: for people; several objects may have the same.
        size: sides of its bounding box along x, y and z of the world [m].
        world_from_mesh: rotation, scale and translation from the coordinates of the file to the world [m],
            rows of a (4, 4) matrix; the identity if it was made by code.
        mesh: path of its file as the recorder was given it; None: made by code.
    """

    name: str
    size: Annotated[tuple[float, float, float], SIDES]
    world_from_mesh: Annotated[Matrix, PLACEMENT]
    mesh: str | None = None


# (x, y, width, height) [px]: the pixels from x to x + width - 1 and from y to y + height - 1.
Box = tuple[int, int, int, int]


POSE = Expect("4 rows of 4 numbers: a rotation with a translation", _is_placement)


@dataclass(frozen=True)
class ObjectView:
    """An object as a camera sees it; pixels count where their centers show it.

    Attributes:
        number: of the object, 1 or more.
        cam_from_object: rotation and translation [m] from the object to the camera, OpenCV axes, rows of a
            (4, 4) matrix. The object's frame is that of its mesh file, scaled to metres.
        pixels: that it would have if nothing hid it, also beyond the image's border, up to an image's width
            and height away.
        pixels_visible: that show it.
        box: around all of ``pixels``; may reach beyond the image. None: it has none.
        box_visible: around those that show it; None: there are none.
        silhouette: the pixels of the image that it would have if nothing hid it, as
            `text_of_mask` writes them; None: they are those that show it.
    """

    number: Annotated[int, Expect("a whole number, 1 or more", lambda value: value >= 1)]
    cam_from_object: Annotated[Matrix, POSE]
    pixels: Annotated[int, COUNT]
    pixels_visible: Annotated[int, COUNT]
    box: Box | None = None
    box_visible: Box | None = None
    silhouette: str | None = None
    DERIVED: ClassVar = ("visible_share",)

    @property
    def visible_share(self) -> float:
        """Share of its pixels that show, 0 to 1; 0 where it has none."""
        return self.pixels_visible / self.pixels if self.pixels else 0.0


# A mask is stored as lengths of runs, in the compressed text of COCO, which BOP's toolkit and pycocotools
# read. The pixels are taken column by column. The runs alternate between 0 and 1, starting with 0; from the
# fourth one on, a run is stored as the difference to the one before the last. Five bits of a number make a
# character, the lowest ones first; a sixth bit says that more follow. See
# https://github.com/cocodataset/cocoapi/blob/master/common/maskApi.c.
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
