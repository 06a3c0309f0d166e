"""Which effects a scene calls for: a pure function from facts to a plan, with a reason for each choice."""

from collections.abc import Collection, Sequence
from dataclasses import replace

from digs_warp.checks import DigsError
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.words import did_you_mean

# "auto": what the scene calls for; "all"; "none"; or names of effects.
Selection = str | Sequence[str]

# Of a plan's table: what an effect changes is a share of the pixels; its cost is processor time.
HEADINGS = ("effect", "state", "changes", "costs", "measured", "rule", "because")

EFFECT_NAMES = tuple(effect.name for effect in EFFECTS)


def plan(facts: SceneFacts, rig: StereoRig, selection: Selection = "auto") -> tuple[Choice, ...]:
    """Return a choice for every effect, in the order in which effects act.

    Args:
        facts: of the scene.
        rig: of the sensor.
        selection: "auto", "all", "none", or the names of the wanted effects (a sequence, or a string with
            commas); anything but "auto" overrides the facts, and the reasons say so.

    Raises:
        DigsError: unknown name of an effect.
    """
    choices = tuple(effect.choose(facts, rig) for effect in EFFECTS)
    wanted = wanted_effects(selection)
    return choices if wanted is None else override(choices, wanted)


def override(choices: Sequence[Choice], wanted: Collection[str]) -> tuple[Choice, ...]:
    """Return the choices with exactly the ``wanted`` effects on; the reasons say what was overridden."""
    return tuple(_overridden(choice, choice.effect in wanted) for choice in choices)


def wanted_effects(
    selection: Selection, known: Sequence[str] = EFFECT_NAMES
) -> frozenset[str] | None:
    """Return the names out of ``known`` that a selection switches on; None for "auto". See `plan`."""
    if selection == "auto":
        return None
    if selection == "all":
        return frozenset(known)
    if selection == "none":
        return frozenset()
    names = selection.split(",") if isinstance(selection, str) else selection
    wanted = frozenset(name.strip() for name in names if name.strip())
    unknown = sorted(wanted - set(known))
    if unknown:
        choices = ["auto", "all", "none", *known]
        raise DigsError(f"--effects: no effect '{unknown[0]}'{did_you_mean(unknown[0], choices)}")
    return wanted


def format_plan(choices: Sequence[Choice]) -> str:
    """Return the plan as a text table: headings, then one line per effect."""
    rows: list[tuple[str, ...]] = [HEADINGS]
    rows += [
        (
            *(c.effect, "on" if c.on else "off", f"{c.share:.1%}", f"{c.cost:.0f} ms/MP"),
            *(c.statistic, c.threshold, c.reason),
        )
        for c in choices
    ]
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    return "\n".join(lines)


def _overridden(choice: Choice, on: bool) -> Choice:
    if choice.on == on:
        return choice
    word = "asked for" if on else "left out"
    return replace(choice, on=on, reason=f"{word} by the user; the rule says: {choice.reason}")
