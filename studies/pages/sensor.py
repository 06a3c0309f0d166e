"""Photographs every effect of the depth camera, off and on; pictures and numbers of docs/sensor.md."""

from collections.abc import Sequence
from inspect import getdoc

from digs_warp.sim.sensor.color import COLOR_EFFECTS
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice, Effect
from digs_warp.sim.sensor.frame import Cause
from digs_warp.study.table import Table
from scripts.page_marks import DOCS, fill
from studies.pages.sensor_pictures import WITHOUT_PICTURE, SensorStudio, draw_all

PAGE = "sensor.md"
PICTURES = "images/sensor"


def main() -> None:
    """Draw the pictures and write what they show into the page."""
    studio = SensorStudio()
    draw_all(studio, DOCS / PICTURES)
    texts = {
        "depth": f"{effects_table(EFFECTS, studio)}\n\n{pictures()}",
        "color": effects_table(COLOR_EFFECTS, studio),
        "causes": Table("causes", ["number", "cause", "meaning"], cause_rows()).markdown(),
    }
    for mark, text in texts.items():
        fill(PAGE, mark, text)


def effects_table(effects: Sequence[Effect], studio: SensorStudio) -> str:
    """Return what each effect does, and where it is on."""
    rows = [
        [f"`{e.name}`", first_paragraph(type(e)), limits(e.choose(studio.facts, studio.rig))]
        for e in effects
    ]
    return Table("effects", ["effect", "what it does", "on where"], rows).markdown()


def pictures() -> str:
    """Return the pictures of the effects on depth."""
    names = [effect.name for effect in EFFECTS if effect.name not in WITHOUT_PICTURE]
    return "\n\n".join(f"![{name}, off and on]({PICTURES}/{name}.jpg)" for name in names)


def limits(choice: Choice) -> str:
    """Return when an effect is on; each limit beside the quantity that it is for."""
    names = [part.partition(" = ")[0] for part in choice.statistic.split(", ")]
    bounds = choice.threshold.split(", ")
    if len(bounds) == len(names) and all(bound.startswith(">") for bound in bounds):
        return ", ".join(f"{name} {bound}" for name, bound in zip(names, bounds, strict=True))
    return choice.threshold


def first_paragraph(thing: object) -> str:
    """Return the first paragraph of a docstring as one line of Markdown."""
    return (getdoc(thing) or "").partition("\n\n")[0].replace("\n", " ").replace("``", "`")


def cause_rows() -> list[list[str]]:
    """Return the table of causes."""
    return [[str(cause.value), cause.name.lower(), cause.meaning] for cause in Cause]
