"""How errors of the sensor reach the result: each effect alone, at rising strength."""

from collections.abc import Sequence
from typing import Any

from digs_warp.study.engine.case import Case
from digs_warp.study.engine.charts import Chart, Curve
from digs_warp.study.engine.page import Section, Table
from digs_warp.study.engine.records import Record, at_iteration, group_by, spread
from digs_warp.study.studies.scenes import objects

STRENGTHS = (0.0, 1.0, 2.0, 4.0)
STRATEGIES = ("highdepth", "depth", "fusion")
ITERATIONS = (100, 1000)

ALL = "all together"


def cases(objects_count: int = 1, seeds: int = 1, iterations: int = 1000) -> list[Case]:
    """Return all effects together first, then each alone; strengths and strategies innermost."""
    from sim.sensor.planner import EFFECT_NAMES

    return [
        Case(
            labels={
                **{"object": name, "effect": effect, "strength": strength},
                **{"strategy": strategy, "seed": seed},
            },
            recording=scene
            | {"frames": 40, "width": 640, "height": 360, "seed": seed, "strength": strength}
            | {"effects": "all" if effect == ALL else effect},
            reconstruction={
                "init.strategy": strategy,
                "train.iterations": iterations,
                "train.seed": seed,
            },
        )
        for seed in range(seeds)
        for effect in (ALL, *EFFECT_NAMES)
        for name, scene in objects(objects_count).items()
        for strength in STRENGTHS
        for strategy in STRATEGIES
    ]


def sections(records: Sequence[Record]) -> list[Section]:
    """Return a table of every effect, and curves of what hurts most."""
    rows = []
    slopes: dict[str, float] = {}
    for (effect, strategy), found in group_by(records, "effect", "strategy").items():
        by_strength = {key[0]: value for key, value in group_by(found, "strength").items()}
        for strength, group in by_strength.items():
            rows.append([effect, strategy, f"{strength:g}", *map(_text, _numbers(group))])
        worst = spread(by_strength.get(STRENGTHS[-1], []), _final_psnr)
        none = spread(by_strength.get(STRENGTHS[0], []), _final_psnr)
        if worst and none:
            slopes[effect] = min(slopes.get(effect, 0.0), worst.mean - none.mean)
    headings = ["effect", "strategy", "strength", "scale error [%]", "points: Chamfer [mm]"]
    headings += [*(f"PSNR after {i} [dB]" for i in ITERATIONS), "PSNR at the end [dB]"]
    order = sorted(slopes, key=slopes.__getitem__)
    text = "Poses are the recording's own. "
    if order:
        text += "What hurts most at four times the usual strength: " + ", ".join(
            f"{effect} ({slopes[effect]:+.1f} dB)" for effect in order[:3]
        )
    return [Section("Effects", text, [Table("effects", headings, rows)], [_chart(records, order)])]


def _chart(records: Sequence[Record], effects: Sequence[str]) -> Chart:
    curves = []
    for effect in effects[:8]:
        found = [r for r in records if r["labels"]["effect"] == effect]
        groups = {k[0]: v for k, v in group_by(found, "strength").items()}
        values = [(strength, spread(group, _final_psnr)) for strength, group in groups.items()]
        known = sorted((strength, value.mean) for strength, value in values if value)
        curves.append(Curve(effect, [x for x, _ in known], [y for _, y in known]))
    title = "What the strength of an effect costs, mean over the strategies"
    return Chart("effects", title, curves, "strength", "PSNR on views of a perfect camera [dB]")


def _numbers(group: Sequence[Record]) -> list[tuple[float | None, int]]:
    """Return the values of a row, each with its number of decimals."""

    def mean(value: Any) -> float | None:
        found = spread(group, value)
        return found.mean if found else None

    return [
        (mean(_scale_error), 3),
        (mean(lambda r: 1e3 * r["surface"]["points"]["chamfer"] if r["surface"] else None), 2),
        *((mean(lambda r, i=i: at_iteration(r, i, "psnr")), 2) for i in ITERATIONS),
        (mean(_final_psnr), 2),
    ]


def _scale_error(record: Record) -> float | None:
    scale = record["results"].get("scale")
    return 100 * abs(scale["sfm_per_metre"] - 1) if scale else None


def _final_psnr(record: Record) -> float | None:
    return record["yardstick"].get("psnr")


def _text(value: tuple[float | None, int]) -> str:
    number, decimals = value
    return "" if number is None else f"{number:.{decimals}f}"
