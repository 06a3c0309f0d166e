"""Durations such as 60s, 20min or 2h, for flags and settings in seconds."""

import re

from tyro.constructors import PrimitiveConstructorSpec

from digs_warp.checks import DigsError

_SECONDS_OF = {"": 1.0, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}


def seconds_of(duration: str) -> float:
    """Convert a text such as 90, 90s, 20min (or 20m) or 1.5h to seconds.

    Raises:
        DigsError: the text has another form, or is zero.
    """
    found = re.fullmatch(r"(\d+\.?\d*)\s*(s|m|min|h)?", duration.strip())
    if found is None or float(found[1]) == 0:
        raise DigsError(f"'{duration}', expected a time such as 60s, 20min or 2h")
    return float(found[1]) * _SECONDS_OF[found[2] or ""]


DURATION = PrimitiveConstructorSpec(
    nargs=1,
    metavar="TIME",
    instance_from_str=lambda texts: seconds_of(texts[0]),
    is_instance=lambda value: value is None or isinstance(value, float | int),
    str_from_instance=lambda value: ["None" if value is None else f"{value:g}s"],
)
"""Annotates a setting in seconds (float, or float | None): the command line reads it with `seconds_of`."""
