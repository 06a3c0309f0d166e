"""The sensor of a simulated capture: which effects it had, and why."""

from digs_warp.capture import Capture
from digs_warp.checks import DigsError
from digs_warp.log import read_json
from digs_warp.report.markup import section, table

PLAN_NAME = "sensor_plan.json"


def sensor_section(capture: Capture) -> str:
    """Return the section, or nothing for a capture without a plan.

    Raises:
        DigsError: a plan that is no plan; the message names the file.
    """
    path = capture.folder / PLAN_NAME
    if not path.is_file():
        return ""
    plan = read_json(path, "sensor plan")
    try:
        rows = [
            (
                c["effect"],
                where,
                "on" if c["on"] else "off",
                c["statistic"],
                c["threshold"],
                c["reason"],
            )
            for key, where in (("color", "images"), ("depth", "depth"))
            for c in plan[key]
        ]
    except (KeyError, TypeError) as error:
        raise DigsError(
            f"sensor plan '{path}': {error!r}; expected lists 'color' and 'depth' of choices; "
            "record again, or delete the file"
        ) from error
    on = sum(row[2] == "on" for row in rows)
    return section(
        "Sensor",
        f"{on} of {len(rows)} effects of the depth camera were simulated; what the scene shows decided.",
        table(["Effect", "Acts on", "State", "Measured", "Rule", "Because"], rows),
    )
