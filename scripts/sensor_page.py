"""Photograph every effect of the depth camera, off and on, and write docs/sensor.md around the pictures.

Usage: python scripts/sensor_page.py   (about half a minute)
"""

import re
import sys
from inspect import getdoc, getsource
from pathlib import Path

from digs_warp.sim.profiles import IMAGE_FIGURES, PROFILES, RIG_FIGURES
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.color import COLOR_EFFECTS
from digs_warp.sim.sensor.color.protocol import ColorEffect
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice, DepthEffect
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.study.sensor_pictures import DRIFT, DepthFigure, SensorStudio, draw_all

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURES = "images/sensor"
SHOWN_PROFILE = "zed2-720"

PAGE = """# The stereo depth camera

This page, pictures and numbers included, is written by `make sensor`. It shows what the simulated camera
does wrong, and when.

A stereo camera finds, for every pixel of its left image, where the same thing lies in the right one. The
shift is the disparity d = f b / Z (focal length in pixels, baseline, depth). Everything that goes wrong
goes wrong there, in pixels; depth inherits it as Z² / (f b) times as much. So the simulator renders both
eyes, takes true disparity from the mesh, lets one *effect* after the other act on it, and turns the result
into depth.

## Tiers

`--tier` chooses how far that goes. For tests of your own code at rising noise there is
[a pytest plug-in](sensor-noise-plugin.md); [sensor-cost.md](sensor-cost.md) tells what each tier and effect
costs in time, and how close to matching it comes.

| tier | depth |
|---|---|
| `truth` | exact |
| `law` | white noise and steps in disparity, and the range: the closed-form law of stereo |
| `planned` | the effects below, each only where the scene calls for it |
| `matcher` | OpenCV's semi-global matching of the two recorded images, with left-right check |

## The plan

Before it records, the camera looks at a few frames and measures facts: how far texture is away, how large
depth steps are, what the materials are, how fast the hand moves. Every effect has a rule on one of them.
`digs-warp plan` prints the outcome without recording; a recording saves it as `sensor_plan.json`, and the
report shows it. An effect that is off costs nothing and changes no byte. `--effects all`, `none` or a list
of names overrides the rules, and `--strength` makes all of them weaker or stronger.

```sh
digs-warp plan --mesh water_bottle.glb
digs-warp simulate --tier planned --effects occlusion,correlated-noise --out out/capture
```

## Effects on depth

Each picture shows the same still life with one effect alone: the left image, disparity as it is (warm is
near), disparity after the effect, and the error (blue: reads too near, red: too far, black: no depth).
Pictures show the part of the frame where most happens. The camera is of ZED 2 class at {width} x {height}
pixels. Rules and facts are the planner's on this scene. Only mis-rectification is shown with another one,
whose calibration has drifted by {drift_rows} px between the rows and {drift_columns} px along them.

{depth}
## Effects on the images

Differences are amplified as their titles say; grey is none.

{color}
## All of them, in numbers

On the still life, each effect alone: pixels that lost their depth, pixels wrong by more than one pixel of
disparity, and the RMS error of those that are off by less.

| effect | lost | bad | RMS of the rest [px] |
|---|---|---|---|
{numbers}

## Why a pixel is missing or wrong

With the tiers `planned` and `matcher` every capture has `cause` images, 8 bits, with one of these numbers
per pixel. The last effect that took or replaced a value has the word; effects that shift values within the
sensor's noise leave the label alone. Missing depth is coded as the ZED does: NaN, minus infinity nearer
than the camera can see, plus infinity farther.

| number | cause | meaning |
|---|---|---|
{causes}

## Cameras

`--profile` takes {profiles}, or a file of your own. Every figure says where it comes from: *measured* on a
device or a real pair, *vendor* from a data sheet, or *tuned* to fit. Those of `{profile}`:

| figure | value | origin | note |
|---|---|---|---|
{figures}

The fields of `StereoRig` in `sim/rig.py` say what the figures mean. A file names a base and what differs:

```yaml
title: my stereo head
base: zed2-720
figures:
  baseline: {{value: 0.2, origin: measured, note: calibration of 3 May}}
  random_invalid: {{value: 0.0, origin: tuned}}
```
"""


def main() -> None:
    """Draw the pictures and write the page."""
    studio = SensorStudio()
    figures = draw_all(studio, DOCS / PICTURES)
    k = studio.rig.intrinsics
    page = PAGE.format(
        width=k.width,
        height=k.height,
        drift_rows=DRIFT["row_offset"],
        drift_columns=DRIFT["column_offset"],
        depth="\n".join(section(e, studio.facts, studio) for e in EFFECTS),
        color="\n".join(section(e, studio.facts, studio) for e in COLOR_EFFECTS),
        numbers="\n".join(number_row(name, figure) for name, figure in figures.items()),
        causes=cause_rows(),
        profiles=", ".join(f"`{name}`" for name in PROFILES),
        profile=SHOWN_PROFILE,
        figures=figure_rows(SHOWN_PROFILE),
    )
    (DOCS / "sensor.md").write_text(page, encoding="utf-8")
    print(DOCS / "sensor.md")  # noqa: T201 (a script)


def section(effect: DepthEffect | ColorEffect, facts: SceneFacts, studio: SensorStudio) -> str:
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


def cause_rows() -> str:
    """Return the table of causes; what they mean stands in the comments of `Cause`."""
    meanings = dict(re.findall(r"^ +([A-Z_]+) = \d+(?:  # (.+))?$", getsource(Cause), re.MULTILINE))
    return "\n".join(
        f"| {cause.value} | {cause.name.lower()} | {meanings[cause.name]} |" for cause in Cause
    )


def number_row(name: str, figure: DepthFigure) -> str:
    """Return a row of the table of errors."""
    rms = f"{figure.rms:.3f}" if figure.rms == figure.rms else ""  # NaN: none
    return f"| {name} | {percent(figure.holes)} | {percent(figure.bad)} | {rms} |"


def percent(share: float) -> str:
    """Return a share in percent, nothing for 0."""
    return f"{share:.2%}" if share else ""


def figure_rows(profile: str) -> str:
    """Return the table of a profile's figures."""
    rows = []
    for name in (*IMAGE_FIGURES, *RIG_FIGURES):
        figure = PROFILES[profile].figures[name]
        rows.append(f"| `{name}` | {figure.value:g} | {figure.origin} | {figure.note} |")
    return "\n".join(rows)


if __name__ == "__main__":
    main()
