"""Photograph every effect of the depth camera, off and on; write pictures and numbers into docs/sensor.md.

Usage: python scripts/sensor_page.py   (about half a minute)
"""

import sys
from inspect import getdoc

from page_marks import DOCS, fill

from digs_warp.sim.camera.profiles import IMAGE_FIGURES, PROFILES, RIG_FIGURES
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.color import COLOR_EFFECTS
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice, SensorEffect
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.study.filter_pictures import FilterFigure, filter_figures
from digs_warp.study.sensor_pictures import SensorStudio, draw_all
from digs_warp.study.table import Table

PAGE = "sensor.md"
PICTURES = "images/sensor"
FILTER_PICTURES = "images/sensor-filters"
SHOWN_PROFILE = "zed2-720"

FILTER_HEADINGS = (
    *("after matching", "fill", "bad-1", "RMS of the rest [px]", "flying pixels"),
    *("filled holes that are right", "their confidence", "time [ms/MP]"),
)


def main() -> None:
    """Draw the pictures and write what they show into the page."""
    studio = SensorStudio()
    draw_all(studio, DOCS / PICTURES)
    texts = {
        "depth": "\n".join(section(effect, studio.facts, studio) for effect in EFFECTS),
        "color": "\n".join(section(effect, studio.facts, studio) for effect in COLOR_EFFECTS),
        "causes": Table("causes", ["number", "cause", "meaning"], cause_rows()).markdown(),
        "figures": Table(
            "figures", ["figure", "value", "origin", "note"], figure_rows()
        ).markdown(),
    }
    filters = filter_figures(DOCS / FILTER_PICTURES)
    texts["filters"] = Table("filters", FILTER_HEADINGS, filter_rows(filters)).markdown()
    for mark, text in texts.items():
        fill(PAGE, mark, text)


def section(effect: SensorEffect, facts: SceneFacts, studio: SensorStudio) -> str:
    """Return heading, explanation, rule and picture of an effect."""
    what = (
        f"{first_paragraph(sys.modules[type(effect).__module__])} {first_paragraph(type(effect))}"
    )
    choice: Choice = effect.choose(facts, studio.rig)
    picture = f"![{effect.name}, off and on]({PICTURES}/{effect.name}.jpg)"
    return f"### {effect.name}\n\n{what}\n\n{rule(choice)}\n\n{picture}\n"


def rule(choice: Choice) -> str:
    """Return when an effect is on, and whether it is here; each limit beside the quantity that it is for."""
    limits, here = choice.threshold, choice.statistic
    measured = [part.partition(" = ") for part in here.split(", ")]
    bounds = limits.split(", ")
    if len(bounds) == len(measured) and all(bound.startswith(">") for bound in bounds):
        names = [name for name, _, _ in measured]
        limits = ", ".join(f"{n} {bound}" for n, bound in zip(names, bounds, strict=True))
        here = ", ".join(value for _, _, value in measured)
    return f"On where {limits}; here {here}: {'on' if choice.on else 'off'}."


def first_paragraph(thing: object) -> str:
    """Return the first paragraph of a docstring as one line of Markdown."""
    return (getdoc(thing) or "").partition("\n\n")[0].replace("\n", " ").replace("``", "`")


def cause_rows() -> list[list[str]]:
    """Return the table of causes."""
    return [[str(cause.value), cause.name.lower(), cause.meaning] for cause in Cause]


def filter_rows(figures: dict[str, FilterFigure]) -> list[list[str]]:
    """Return the table of filters."""
    rows = []
    for name, figure in figures.items():
        values = [figure.fill, figure.bad_1, figure.rms, figure.flying]
        filled = [figure.filled_right, figure.filled_confidence]
        cells = [f"{value:.3f}" if value == value else "" for value in [*values, *filled]]
        rows.append([name, *cells, f"{figure.time:.0f}"])
    return rows


def figure_rows() -> list[list[str]]:
    """Return the table of a profile's figures."""
    figures = PROFILES[SHOWN_PROFILE].figures
    return [
        [f"`{name}`", f"{figures[name].value:g}", figures[name].origin, figures[name].note]
        for name in (*IMAGE_FIGURES, *RIG_FIGURES)
    ]


if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit(__doc__)
    main()
