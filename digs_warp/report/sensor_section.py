"""The sensor of a simulated capture: which effects it had, and why."""

from typing import Any

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.record.files import read_json
from digs_warp.record.layout import SENSOR_PLAN
from digs_warp.report.markup import section, table

# Heading -> key in the plan.
PATHS = {"On the images": "color", "On depth": "depth"}


def sensor_section(capture: Capture) -> str:
    """Return the section, or nothing for a capture without a plan.

    Raises:
        DigsError: the file is not a valid plan; the message names it.
    """
    path = capture.folder / SENSOR_PLAN
    if not path.is_file():
        return ""
    plan = read_json(path, "sensor plan")
    try:
        tables = {title: _rows(plan[key]) for title, key in PATHS.items()}
    except (KeyError, TypeError) as error:
        raise DigsError(
            f"sensor plan '{path}': {error!r}; expected lists 'color' and 'depth' of choices; "
            "record again, or delete the file"
        ) from error
    rows = [row for group in tables.values() for row in group]
    on = sum(row[1] == "on" for row in rows)
    headings = ["Effect", "State", "Measured", "Rule", "Because"]
    parts = [
        f"<h3>{title}</h3>{table(headings, group)}" for title, group in tables.items() if group
    ]
    return section(
        "Sensor",
        f"{on} of {len(rows)} effects of the depth camera were simulated, chosen by what the scene shows.",
        *parts,
    )


def _rows(choices: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    return [
        (c["effect"], "on" if c["on"] else "off", c["statistic"], c["threshold"], c["reason"])
        for c in choices
    ]
