"""Durations as people write them: 60s, 20min, 2h."""

import math
import re

from digs_warp.checks import DigsError

_SECONDS_OF = {"": 1.0, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}


def seconds_of(duration: str, flag: str) -> float:
    """Return the seconds of a text such as 90, 90s, 20min (or 20m) or 1.5h; infinity for an empty one.

    Args:
        duration: the text.
        flag: what it was given for, for the message.

    Raises:
        DigsError: the text is something else, or no time above zero.
    """
    if not duration:
        return math.inf
    found = re.fullmatch(r"(\d+\.?\d*)\s*(s|m|min|h)?", duration.strip())
    if found is None or float(found[1]) == 0:
        raise DigsError(f"{flag}: '{duration}', expected a time such as 60s, 20min or 2h")
    return float(found[1]) * _SECONDS_OF[found[2] or ""]
