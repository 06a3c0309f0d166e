"""Photographs every effect of the depth camera, off and on; pictures and numbers of docs/sensor.md."""

import sys
from inspect import getdoc

from digs_warp.sim.camera.profiles import IMAGE_FIGURES, RIG_FIGURES, load_profile
from digs_warp.sim.sensor.color import COLOR_EFFECTS
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice, SensorEffect
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import Cause
from digs_warp.study.table import Table
from scripts.page_marks import DOCS, fill
from studies.pages.sensor_pictures import WITHOUT_PICTURE, SensorStudio, draw_all

PAGE = "sensor.md"
PICTURES = "images/sensor"
SHOWN_PROFILE = "zed2-720"


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
    for mark, text in texts.items():
        fill(PAGE, mark, text)


def section(effect: SensorEffect, facts: SceneFacts, studio: SensorStudio) -> str:
    """Return heading, explanation, rule and picture of an effect."""
    what = (
        f"{first_paragraph(sys.modules[type(effect).__module__])} {first_paragraph(type(effect))}"
    )
    choice: Choice = effect.choose(facts, studio.rig)
    text = f"### {effect.name}\n\n{what}\n\n{rule(choice)}\n"
    if effect in COLOR_EFFECTS or effect.name in WITHOUT_PICTURE:
        return text
    return f"{text}\n![{effect.name}, off and on]({PICTURES}/{effect.name}.jpg)\n"


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


def figure_rows() -> list[list[str]]:
    """Return the table of a profile's figures."""
    figures = load_profile(SHOWN_PROFILE).figures
    return [
        [f"`{name}`", f"{figures[name].value:g}", figures[name].origin, figures[name].note]
        for name in (*IMAGE_FIGURES, *RIG_FIGURES)
    ]
