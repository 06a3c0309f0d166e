"""Why a depth pixel is missing or wrong: the labels of the capture's ``cause`` images."""

from enum import IntEnum


class Cause(IntEnum):
    """One label per pixel, set by the last effect that removed or replaced the value.

    Effects that only shift a value within the sensor's noise (steps, static field) do not change the label.
    Numbers that are missing here belong to causes that no tier has any more.

    Attributes:
        meaning: in words, for people.
    """

    meaning: str

    def __new__(cls, number: int, meaning: str) -> "Cause":
        """Return a member; it is its number."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.meaning = meaning
        return member

    OK = 0, "right up to the sensor's noise"
    BAND = 1, "the left margin, outside the right eye's view"
    OCCLUDED = 2, "hidden from the right eye by something nearer"
    WEAK_TEXTURE = 4, "texture below the image noise"
    SPECULAR = 6, "the highlight was matched, not the surface"
    MIRROR = 7, "the reflected scene was matched"
    TRANSPARENT = 8, "the background behind glass was matched"
    EXPOSURE = 9, "saturated or too dark to match"
    NEAR = 10, "nearer than the sensor's range"
    FAR = 11, "farther than the sensor's range"
    EDGE = 12, "the matching window straddles a depth step"
    FILTERED = 13, "a filter moved it by more than a pixel"
    RECTIFICATION = 15, "the calibration has drifted: wrong columns, or rows that are not aligned"
    RANDOM = 16, "dropped for no visible reason"
    FILLED = 17, "a hole that a filter filled"
    LOW_CONFIDENCE = 18, "below the confidence threshold"
