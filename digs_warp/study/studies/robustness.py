"""The effect of sensor errors on the result: all together for every strategy, then each effect alone."""

from collections.abc import Mapping, Sequence
from typing import Any

from digs_warp.study.charts import Chart
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import (
    AT_TWICE,
    Column,
    Groups,
    Record,
    Spread,
    at_iteration,
    curve,
    double_psnr,
    final_psnr,
    group_by,
    number,
    spread,
    tabulate,
)
from digs_warp.study.page import Section
from digs_warp.study.scenes import Objects, voxel_size
from digs_warp.study.table import Table

# The largest first: it shows whether an effect matters at all.
STRENGTHS = (4.0, 1.0, 2.0)
STRATEGIES = ("highdepth", "depth", "fusion", "default", "random")
MAIN = "highdepth"
ITERATIONS = (100, 300)

ALL, NONE = "all together", "none"

# Small, because there are many effects. Poses come from the recording, so that nothing else is wrong.
RECORDING: dict[str, Any] = {"frames": 24, "width": 400, "height": 225, "samples_per_pixel": 2}


def cases(objects: Objects, seeds: int = 1, iterations: int = 300) -> list[Case]:
    """Return the cases: no effect and all of them for every strategy, then each effect for the main one."""
    from digs_warp.sim.record.sensor_plan import ALL_EFFECT_NAMES

    others = [strategy for strategy in STRATEGIES if strategy != MAIN]
    settings = [(NONE, 0.0, strategy) for strategy in STRATEGIES]
    settings += [(ALL, strength, MAIN) for strength in STRENGTHS]
    settings += [(effect, STRENGTHS[0], MAIN) for effect in ALL_EFFECT_NAMES]
    settings += [(ALL, strength, strategy) for strength in STRENGTHS for strategy in others]
    settings += [
        (effect, strength, MAIN) for strength in STRENGTHS[1:] for effect in ALL_EFFECT_NAMES
    ]
    return [
        _case(name, scene, effect, strength, strategy, seed, iterations)
        for seed in range(seeds)
        for effect, strength, strategy in settings
        for name, scene in objects.items()
    ]


def _case(
    name: str,
    scene: Mapping[str, Any],
    effect: str,
    strength: float,
    strategy: str,
    seed: int,
    iterations: int,
) -> Case:
    return Case(
        labels={
            **{"object": name, "effect": effect, "strength": strength},
            **{"strategy": strategy, "seed": seed},
        },
        recording={**scene, **RECORDING, "seed": seed}
        # Without effects, the sensor still matches the images: strength 0 would be the truth.
        | {"strength": strength or 1.0, "effects": "all" if effect == ALL else effect},
        reconstruction={
            "init.strategy": strategy,
            "init.voxel_size": voxel_size(strategy),
            "train.stop.iterations": iterations,
            "train.seed": seed,
        },
    )


def sections(records: Sequence[Record]) -> list[Section]:
    """Return strategies under all effects, each effect alone, and which stage each of them hurts."""
    groups = group_by(records, "effect", "strength", "strategy")
    found = [_strategies(groups), _effects(groups), _stages(groups)]
    return [section for section in found if any(table.rows for table in section.tables)]


COLUMNS = (
    Column("points: Chamfer [mm]", 2, number("surface", "points", "chamfer", factor=1e3)),
    *(Column(f"PSNR after {i} [dB]", 2, at_iteration(i, "psnr_object")) for i in ITERATIONS),
    Column("PSNR at the end [dB]", 2, final_psnr),
    Column(f"{AT_TWICE} [dB]", 2, double_psnr),
)


def _strategies(groups: Groups) -> Section:
    settings = ((NONE, 0.0), *((ALL, strength) for strength in sorted(STRENGTHS)))
    rows = {
        (strategy, strength): groups[effect, strength, strategy]
        for strategy in STRATEGIES
        for effect, strength in settings
        if (effect, strength, strategy) in groups
    }
    curves = [
        curve(
            strategy,
            {x: found for (name, x), found in rows.items() if name == strategy},
            final_psnr,
        )
        for strategy in STRATEGIES
    ]
    chart = Chart(
        *("strategies", "All effects together, by strategy", curves),
        *("strength of the effects (1: a real camera)", "PSNR on views of a perfect camera [dB]"),
    )
    text = (
        "All effects at once, at 0, 1, 2 and 4 times their real strength. Default and Random do not start "
        "from depth: their loss comes from the photographs alone (blur, grain, vignetting). PSNR at the end "
        "is measured after one brightness and white balance are fitted to all views: where the camera adapts "
        f"to the light, nothing tells those of the scene. {AT_TWICE.capitalize()}: the same in views from "
        "half the distance."
    )
    table = tabulate("strategies", ("strategy", "strength"), rows, COLUMNS)
    return Section("All effects together", text, [table], [chart])


def _effects(groups: Groups) -> Section:
    rows = {
        (effect, strength): groups[effect, strength, MAIN]
        for effect in _by_harm(groups)
        for strength in sorted(STRENGTHS)
        if (effect, strength, MAIN) in groups
    }
    if clean := groups.get((NONE, 0.0, MAIN)):
        rows[NONE, 0.0] = clean
    worst = _by_harm(groups)[:3]
    text = (
        f"Each effect alone, with {MAIN}, the most harmful first. Without any (strength 0), the sensor still "
        "errs as a matcher does on clean images."
    )
    if worst:
        text += f" These cost the most final quality: {', '.join(worst)}."
    if idle := _idle(groups):
        text += (
            " These need something that this scene does not have (clear or mirroring material, fast "
            f"motion, a misaligned rig) and changed nothing: {', '.join(idle)}."
        )
    table = tabulate("effects", ("effect", "strength"), rows, COLUMNS)
    return Section("Each effect alone", text, [table], [_chart(groups)] if rows else [])


def _stages(groups: Groups) -> Section:
    """Show which stage an effect at its largest strength hurts: points, early or late training."""
    clean = groups.get((NONE, 0.0, MAIN))
    rows = [
        [effect, *(column.difference(found, clean) for column in COLUMNS)]
        for effect in _by_harm(groups)
        if clean and (found := groups.get((effect, max(STRENGTHS), MAIN)))
    ]
    text = (
        f"The change from no effect to {max(STRENGTHS):g} times the real strength. Chamfer distances show "
        "harm before the training, PSNR after 100 steps a worse start, and PSNR at the end what the training "
        "could not make up for."
    )
    headings = ["effect", *(column.heading for column in COLUMNS)]
    return Section("Which stage is hurt", text, [Table("stages", headings, rows)])


def _by_harm(groups: Groups) -> list[str]:
    """Return the single effects that change anything, the most harmful at its largest strength first."""
    idle = _idle(groups)
    strongest: dict[str, tuple[float, float]] = {}
    for (effect, strength, strategy), found in groups.items():
        quality = spread(found, final_psnr)
        if effect in (ALL, NONE, *idle) or strategy != MAIN or not quality:
            continue
        strongest[effect] = max(strongest.get(effect, (0.0, 0.0)), (strength, quality.mean))
    return sorted(strongest, key=lambda effect: strongest[effect][1])


def _idle(groups: Groups) -> list[str]:
    """Return the single effects that change nothing, to the last bit."""
    if not (clean := groups.get((NONE, 0.0, MAIN))):
        return []
    usual = _values(clean)
    changed: dict[str, bool] = {}
    for (effect, _, strategy), found in groups.items():
        if effect not in (ALL, NONE) and strategy == MAIN:
            changed[effect] = changed.get(effect, False) or _values(found) != usual
    return [effect for effect, any_change in changed.items() if not any_change]


def _values(group: Sequence[Record]) -> list[Spread | None]:
    return [spread(group, column.value) for column in COLUMNS]


def _chart(groups: Groups) -> Chart:
    curves = []
    for effect in _by_harm(groups)[:6]:
        points = {0.0: groups.get((NONE, 0.0, MAIN), [])}
        points |= {s: groups.get((effect, s, MAIN), []) for s in sorted(STRENGTHS)}
        curves.append(curve(effect, points, final_psnr))
    title = "The six most harmful effects"
    labels = ("strength (1: a real camera)", "PSNR on views of a perfect camera [dB]")
    return Chart("effects", title, curves, *labels)
