"""The values of an occlusion image: whether another image shows the point of a pixel."""

from enum import IntEnum


class Occlusion(IntEnum):
    """Whether another image, the other eye's or the next frame's, shows the point at a pixel center."""

    SEEN = 0
    OUTSIDE = (
        128  # the point projects outside of that image; whether something hides it was not checked
    )
    HIDDEN = 255  # something is in front of the point, or that camera sees the back of the same thin sheet
