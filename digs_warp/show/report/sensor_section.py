"""The sensor of a simulated capture: which effects it had, and why."""

from digs_warp.data.capture import Capture
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json
from digs_warp.record.layout import SENSOR_PLAN
from digs_warp.show.report.markup import section, table

# Heading -> key in the plan.
PATHS = {"On the images": "color", "On depth": "depth"}

# What the user asked for; older plans do not list it.
ASKED_FOR = {"After matching": "after"}


def sensor_section(capture: Capture) -> str:
    """Return the section, or nothing for a capture without a plan.

    Raises:
        DigsError: the file is not a valid plan; the message names it.
    """
    path = capture.folder / SENSOR_PLAN
    if not path.is_file():
        return ""
    content = read_json(path, "sensor plan")
    plan = Fields(content, f"sensor plan '{path}'", remedy="record again, or delete the file")
    tables = {title: _rows(plan.sections(key)) for title, key in PATHS.items()}
    rows = [row for group in tables.values() for row in group]
    on = sum(row[1] == "on" for row in rows)
    headings = ["Effect", "State", "Changes", "Costs [ms/MP]", "Measured", "Rule", "Because"]
    tables |= {title: _rows(plan.sections(key, [])) for title, key in ASKED_FOR.items()}
    parts = [
        f"<h3>{title}</h3>{table(headings, group)}" for title, group in tables.items() if group
    ]
    return section(
        "Sensor",
        f"{on} of {len(rows)} effects of the depth camera were simulated, chosen by what the scene shows.",
        *parts,
    )


def _rows(choices: list[Fields]) -> list[tuple[str, ...]]:
    return [
        (
            choice.text("effect"),
            "on" if choice.flag("on") else "off",
            # Plans of earlier versions have neither.
            f"{choice.number('share', default=0.0):.1%}",
            f"{choice.number('cost', default=0.0):.0f}",
            *(choice.text(name) for name in ("statistic", "threshold", "reason")),
        )
        for choice in choices
    ]
