"""The values of an occlusion image: whether another image shows the point of a pixel."""

from enum import IntEnum


class Occlusion(IntEnum):
    """What became of the point at a pixel center in another image: the other eye's, or the next frame's."""

    SEEN = 0
    OUTSIDE = 128  # it lies outside of that image, whether or not something hides it
    HIDDEN = 255  # something stands in front of it, or it is the other side of a thin sheet
