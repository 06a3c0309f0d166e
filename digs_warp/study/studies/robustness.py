"""How errors of the sensor reach the result: all together for every strategy, then each effect alone."""

from collections.abc import Mapping, Sequence
from typing import Any

from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import Record, Spread, at_iteration, group_by, spread
from digs_warp.study.page import Section
from digs_warp.study.scenes import objects
from digs_warp.study.table import Table

# The largest first: it tells whether an effect matters at all.
STRENGTHS = (4.0, 1.0, 2.0)
STRATEGIES = ("highdepth", "depth", "fusion", "default", "random")
MAIN = "highdepth"
ITERATIONS = (100, 300)

ALL, NONE = "all together", "none"

# Small, because there are two dozen effects; poses are the recording's own, so that nothing else is wrong.
RECORDING: dict[str, Any] = {"frames": 24, "width": 400, "height": 225, "samples_per_pixel": 2}


def cases(objects_count: int = 1, seeds: int = 1, iterations: int = 300) -> list[Case]:
    """Return the cases: no effect and all of them for every strategy, then each effect for the main one."""
    from digs_warp.sim.sensor_plan import ALL_EFFECT_NAMES

    settings = [(NONE, 0.0, strategy) for strategy in STRATEGIES]
    settings += [(ALL, strength, strategy) for strength in STRENGTHS for strategy in STRATEGIES]
    settings += [(effect, strength, MAIN) for strength in STRENGTHS for effect in ALL_EFFECT_NAMES]
    return [
        _case(name, scene, effect, strength, strategy, seed, iterations)
        for seed in range(seeds)
        for name, scene in objects(objects_count).items()
        for effect, strength, strategy in settings
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
        | {"strength": strength, "effects": "all" if effect == ALL else effect},
        reconstruction={
            "init.strategy": strategy,
            "train.stop.iterations": iterations,
            "train.seed": seed,
        },
    )


def sections(records: Sequence[Record]) -> list[Section]:
    """Return strategies under all effects, each effect alone, and which stage each of them hurts."""
    groups = group_by(records, "effect", "strength", "strategy")
    found = [_strategies(groups), _effects(groups), _stages(groups)]
    return [section for section in found if any(table.rows for table in section.tables)]


Groups = Mapping[tuple[Any, ...], list[Record]]


def _strategies(groups: Groups) -> Section:
    rows = []
    curves = []
    for strategy in STRATEGIES:
        points = []
        for effect, strength in ((NONE, 0.0), *((ALL, s) for s in sorted(STRENGTHS))):
            found = groups.get((effect, strength, strategy))
            if found:
                rows.append([strategy, f"{strength:g}", *_texts(found)])
                quality = spread(found, _final_psnr)
                points += [(strength, quality.mean)] if quality else []
        curves.append(Curve(strategy, [x for x, _ in points], [y for _, y in points]))
    chart = Chart(
        *("strategies", "All effects together, by strategy", curves),
        *("strength of the effects (1: a real camera)", "PSNR on views of a perfect camera [dB]"),
    )
    text = (
        "Every effect at once at 0, 1, 2 and 4 times its real strength. Default and Random do not start from "
        "depth: what they lose is what the photographs have lost (blur, grain, vignetting)."
    )
    headings = ["strategy", "strength", *_headings()]
    return Section("All effects together", text, [Table("strategies", headings, rows)], [chart])


def _effects(groups: Groups) -> Section:
    rows = []
    for effect in _by_harm(groups):
        for strength in sorted(STRENGTHS):
            if found := groups.get((effect, strength, MAIN)):
                rows.append([effect, f"{strength:g}", *_texts(found)])
    if clean := groups.get((NONE, 0.0, MAIN)):
        rows.append([NONE, "0", *_texts(clean)])
    worst = _by_harm(groups)[:3]
    text = f"Each effect alone, with {MAIN}; the most harmful first."
    if worst:
        text += f" What costs most of the final quality: {', '.join(worst)}."
    if idle := _idle(groups):
        text += (
            f" Found nothing to work on here (clear or mirroring material, fast motion, a rig out "
            f"of adjustment), and changed nothing: {', '.join(idle)}."
        )
    table = Table("effects", ["effect", "strength", *_headings()], rows)
    return Section("Each effect alone", text, [table], [_chart(groups)] if rows else [])


def _stages(groups: Groups) -> Section:
    """Say which stage an effect at the largest strength hurts: scale, points, early or late training."""
    clean = groups.get((NONE, 0.0, MAIN))
    rows = []
    if clean:
        usual = _values(clean)
        for effect in _by_harm(groups):
            if found := groups.get((effect, max(STRENGTHS), MAIN)):
                changes = [
                    "" if a is None or b is None else f"{a.mean - b.mean:+.{decimals}f}"
                    for a, b, decimals in zip(_values(found), usual, DECIMALS, strict=True)
                ]
                rows.append([effect, *changes])
    text = (
        f"What {max(STRENGTHS):g} times the real strength changes, against no effect at all. Scale error "
        "and Chamfer distance: harm before the training. PSNR after 100 steps: what the start has lost. PSNR "
        "at the end: what training could not make up for."
    )
    return Section("Which stage is hurt", text, [Table("stages", ["effect", *_headings()], rows)])


def _by_harm(groups: Groups) -> list[str]:
    """Return the single effects that change anything, first those whose largest strength leaves the least."""
    idle = _idle(groups)
    strongest: dict[str, tuple[float, float]] = {}
    for (effect, strength, strategy), found in groups.items():
        quality = spread(found, _final_psnr)
        if effect in (ALL, NONE, *idle) or strategy != MAIN or not quality:
            continue
        strongest[effect] = max(strongest.get(effect, (0.0, 0.0)), (strength, quality.mean))
    return sorted(strongest, key=lambda effect: strongest[effect][1])


def _idle(groups: Groups) -> list[str]:
    """Return the single effects with which everything comes out as without, to the last bit."""
    if not (clean := groups.get((NONE, 0.0, MAIN))):
        return []
    usual = _values(clean)
    changed: dict[str, bool] = {}
    for (effect, _, strategy), found in groups.items():
        if effect not in (ALL, NONE) and strategy == MAIN:
            changed[effect] = changed.get(effect, False) or _values(found) != usual
    return [effect for effect, any_change in changed.items() if not any_change]


def _chart(groups: Groups) -> Chart:
    curves = []
    clean = groups.get((NONE, 0.0, MAIN), [])
    for effect in _by_harm(groups)[:6]:
        values = [(0.0, spread(clean, _final_psnr))]
        values += [(s, spread(groups.get((effect, s, MAIN), []), _final_psnr)) for s in STRENGTHS]
        known = sorted((strength, value.mean) for strength, value in values if value)
        curves.append(Curve(effect, [x for x, _ in known], [y for _, y in known]))
    title = "The six most harmful effects"
    labels = ("strength (1: a real camera)", "PSNR on views of a perfect camera [dB]")
    return Chart("effects", title, curves, *labels)


DECIMALS = (3, 2, *(2 for _ in ITERATIONS), 2)


def _headings() -> list[str]:
    return [
        *("scale error [%]", "points: Chamfer [mm]"),
        *(f"PSNR after {i} [dB]" for i in ITERATIONS),
        "PSNR at the end [dB]",
    ]


def _values(group: Sequence[Record]) -> list[Spread | None]:
    """Return the values of a row, in the order of the headings."""
    return [
        spread(group, lambda r: 100 * r["scale_error"]),
        spread(group, lambda r: 1e3 * r["surface"]["points"]["chamfer"] if r["surface"] else None),
        *(spread(group, lambda r, i=i: at_iteration(r, i, "psnr")) for i in ITERATIONS),
        spread(group, _final_psnr),
    ]


def _texts(group: Sequence[Record]) -> list[str]:
    return [
        value.text(decimals) if value else ""
        for value, decimals in zip(_values(group), DECIMALS, strict=True)
    ]


def _final_psnr(record: Record) -> float | None:
    return record["yardstick"].get("psnr")
