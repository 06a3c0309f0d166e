"""Why a depth pixel is missing or wrong: the labels of the capture's ``cause`` images."""

from enum import IntEnum


class Cause(IntEnum):
    """One label per pixel; the last effect that took or replaced the value has the word.

    Effects that only shift a value within the sensor's noise (noise, ripple, steps, the static field)
    leave the label alone.
    """

    OK = 0
    BAND = 1  # the left margin that the right eye does not see
    OCCLUDED = 2  # hidden from the right eye by something nearer
    TEXTURELESS = 3  # far from anything to match
    WEAK_TEXTURE = 4  # texture below the image noise
    GRAZING = 5  # surface seen too flatly: the two eyes see different widths
    SPECULAR = 6  # the highlight was matched, not the surface
    MIRROR = 7  # the reflected scene was matched
    TRANSPARENT = 8  # what lies behind was matched
    EXPOSURE = 9  # saturated or too dark to match
    NEAR = 10  # nearer than the sensor can
    FAR = 11  # farther than the sensor can
    EDGE = 12  # the matching window straddles a depth step
    FLYING = 13  # a filter blended foreground and background
    MOTION = 14  # blurred by motion
    RECTIFICATION = 15  # the rows of the two eyes do not meet
    RANDOM = 16  # dropped without a visible reason
