"""The effect of sensor errors on the result: all together for every strategy, then each effect alone."""

from collections.abc import Sequence
from typing import Any

from digs_warp.study.charts import Chart
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import (
    AT_TWICE,
    Column,
    Groups,
    Record,
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

# The largest first: it shows whether an effect matters at all.
STRENGTHS = (4.0, 1.0, 2.0)
STRATEGIES = ("highdepth", "depth", "fusion", "default", "random")
MAIN = "highdepth"
ITERATIONS = (100, 300)

ALL, NONE = "all together", "none"

# Small, because there are many effects. Poses come from the recording, so that nothing else is wrong.
RECORDING: dict[str, Any] = {"frames": 24, "width": 400, "height": 225, "samples_per_pixel": 2}

COLUMNS = (
    Column("points: Chamfer [mm]", 2, number("surface", "points", "chamfer", factor=1e3)),
    *(Column(f"PSNR after {i} [dB]", 2, at_iteration(i, "psnr_object")) for i in ITERATIONS),
    Column("PSNR at the end [dB]", 2, final_psnr),
    Column(f"{AT_TWICE} [dB]", 2, double_psnr),
)
AXES = ("strength (1: a real camera)", "PSNR on views of a perfect camera [dB]")


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
        Case(
            labels={
                **{"object": name, "effect": effect, "strength": strength},
                **{"strategy": strategy, "seed": seed},
            },
            recording={
                **scene,
                **RECORDING,
                "seed": seed,
                # Without effects, the sensor still matches the images: strength 0 would be the truth.
                "strength": strength or 1.0,
                "effects": "all" if effect == ALL else effect,
            },
            reconstruction={
                "init.strategy": strategy,
                "init.voxel_size": voxel_size(strategy),
                "train.stop.iterations": iterations,
                "train.seed": seed,
            },
        )
        for seed in range(seeds)
        for effect, strength, strategy in settings
        for name, scene in objects.items()
    ]


def sections(records: Sequence[Record]) -> list[Section]:
    """Return strategies under all effects, and each effect alone."""
    groups = group_by(records, "effect", "strength", "strategy")
    return [_strategies(groups), _effects(groups)]


def _strategies(groups: Groups) -> Section:
    settings = ((NONE, 0.0), *((ALL, strength) for strength in sorted(STRENGTHS)))
    rows = {
        (strategy, strength): groups[effect, strength, strategy]
        for strategy in STRATEGIES
        for effect, strength in settings
        if (effect, strength, strategy) in groups
    }
    curves = [
        curve(name, {x: found for (of, x), found in rows.items() if of == name}, final_psnr)
        for name in STRATEGIES
    ]
    text = (
        "All effects at once, at 0, 1, 2 and 4 times their real strength. Default and Random do not start "
        "from depth: their loss comes from the photographs alone (blur, grain, vignetting). PSNR at the end "
        "is measured after one brightness and white balance are fitted to all views: where the camera adapts "
        f"to the light, nothing tells those of the scene. {AT_TWICE.capitalize()}: the same in views from "
        "half the distance."
    )
    table = tabulate("strategies", ("strategy", "strength"), rows, COLUMNS)
    chart = Chart("strategies", "All effects together, by strategy", curves, *AXES)
    return Section("All effects together", text, [table], [chart])


def _effects(groups: Groups) -> Section:
    harmful = _by_harm(groups)
    strengths = sorted(STRENGTHS)
    wanted = [*((effect, s) for effect in harmful for s in strengths), (NONE, 0.0)]
    rows = {key: groups[*key, MAIN] for key in wanted if (*key, MAIN) in groups}
    text = (
        f"Each effect alone, with {MAIN}, the most harmful first. Without any (strength 0), the sensor still "
        "errs as a matcher does on clean images. Chamfer distances show harm before the training, PSNR after "
        f"{ITERATIONS[0]} steps a worse start, and PSNR at the end what the training could not make up for. "
        "Effects that need clear or mirroring material, fast motion or a misaligned rig change nothing where "
        "the scene has none."
    )
    curves = [
        curve(
            effect,
            {s: groups.get((effect if s else NONE, s, MAIN), []) for s in (0.0, *strengths)},
            final_psnr,
        )
        for effect in harmful[:6]
    ]
    table = tabulate("effects", ("effect", "strength"), rows, COLUMNS)
    chart = Chart("effects", "The six most harmful effects", curves, *AXES)
    return Section("Each effect alone", text, [table], [chart])


def _by_harm(groups: Groups) -> list[str]:
    """Return the single effects, the most harmful at its largest strength first."""
    strongest = {
        effect: found.mean
        for effect, strength, strategy in sorted(groups)
        if effect not in (ALL, NONE) and strategy == MAIN
        if (found := spread(groups[effect, strength, strategy], final_psnr))
    }
    return sorted(strongest, key=strongest.__getitem__)
