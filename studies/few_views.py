"""Few views: what a start from the sensor's depth, and depth in the loss, are worth with 3 to 24 views."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from digs_warp.init.strategies import STRATEGIES, StrategyName
from digs_warp.init.unseen import FEW_VIEWS
from digs_warp.study.charts import Chart
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import (
    Column,
    Record,
    curve,
    final_psnr,
    group_by,
    number,
    spread,
    tabulate,
)
from digs_warp.study.page import Section
from digs_warp.study.scenes import VOXEL, Objects
from digs_warp.study.table import Table

VIEWS = (3, 6, 12, 24)
# Few-shot methods: novel views of the LLFF scenes from three photographs, PSNR [dB]. FSGS: arXiv 2312.00451;
# DNGaussian: arXiv 2403.06912; CoR-GS: arXiv 2405.12110.
LLFF_VIEWS = 3
LLFF_PSNR = {"DNGaussian": 19.12, "FSGS": 20.43, "CoR-GS": 20.45}

# Start from depth whose back is left open where no view saw the object, to compare.
OPEN = "highdepth, open"
STARTS: dict[str, StrategyName] = {
    **{"highdepth": "highdepth", OPEN: "highdepth"},
    **{"default": "default", "random": "random"},
}
# Depth in the loss -> its weight; None is the default of a recording with depth.
LOSS: dict[str, float | None] = {"on": None, "off": 0.0}
# Random points do without structure from motion, which few views often do not give.
RANDOM_POINTS = 10_000
# Every second frame is held out: between any two training views is one that none of them saw.
HELD_OUT = 2


def cases(objects: Objects, seeds: int = 1, iterations: int = 1000) -> list[Case]:
    """Return the cases, object by object; the fewest views come first."""
    return [
        case
        for seed in range(seeds)
        for name, scene in objects.items()
        for case in _of_object(name, scene, seed, iterations)
    ]


def _of_object(title: str, scene: Mapping[str, Any], seed: int, iterations: int) -> list[Case]:
    return [
        Case(
            labels={
                **{"object": title, "views": views, "strategy": name, "depth loss": loss},
                "seed": seed,
            },
            recording={
                **scene,
                **{"frames": HELD_OUT * views, "width": 480, "height": 270, "seed": seed},
            },
            reconstruction={
                **{"test_every": HELD_OUT, **_start(name)},
                "train.depth_weight": weight,
                **{"train.stop.iterations": iterations, "train.seed": seed},
            },
        )
        for views in VIEWS
        for name in STARTS
        for loss, weight in LOSS.items()
        if name != OPEN or (weight is None and views <= FEW_VIEWS)
    ]


def _start(name: str) -> dict[str, Any]:
    """Return the settings of a start."""
    strategy = STARTS[name]
    settings = {"init.strategy": strategy, "train.density.strategy": STRATEGIES[strategy].density}
    if strategy == "random":
        return {**settings, "init.target_points": RANDOM_POINTS}
    fill = "off" if name == OPEN else "auto"
    return {**settings, "init.voxel_size": VOXEL, "init.fill_unseen": fill}


def sections(records: Sequence[Record]) -> list[Section]:
    """Return quality by views, what depth in the loss gains, when to stop, and published figures."""
    return [_quality(records), _loss(records), _early(records), _published(records)]


def best_of_course(record: Record) -> float | None:
    """Return the highest PSNR on the object in held-out views along the training [dB]."""
    return max((v for row in record["course"] if (v := row.get("psnr_object"))), default=None)


def lost_at_the_end(record: Record) -> float | None:
    """Return by how much held-out views are worse at the end than at their best [dB]."""
    best, end = best_of_course(record), number("metrics", "psnr_object")(record)
    return None if best is None or end is None else max(0.0, best - end)


def _quality(records: Sequence[Record]) -> Section:
    columns = [
        Column("PSNR, object [dB]", 2, final_psnr),
        Column("held-out views [dB]", 2, number("metrics", "psnr_object")),
        Column("depth error [mm]", 2, number("yardstick", "depth_mae", factor=1e3)),
        Column("covered [%]", 1, number("yardstick", "depth_seen", factor=100)),
    ]
    curves = []
    for (strategy, loss), found in group_by(records, "strategy", "depth loss").items():
        by_views = {views: group for (views,), group in group_by(found, "views").items()}
        curves.append(curve(_name(strategy, loss), dict(sorted(by_views.items())), final_psnr))
    chart = Chart(
        *("few_views", "Quality by the number of views", curves),
        *("training views", "PSNR on views of a perfect camera [dB]"),
        log_x=True,
    )
    labels = ("views", "strategy", "depth loss")
    text = (
        "The training views are spread over the whole walk around the object, so three of them are a third "
        "of a turn apart. The first columns are measured on the same eight views of a perfect camera for "
        "every number of views, with one brightness and white balance fitted to all of them; the held-out "
        "views lie between the training views of the recording. Poses "
        f"are those of the recording for all strategies. Up to {FEW_VIEWS} views, highdepth closes the "
        f"object where no view saw it; '{OPEN}' leaves it open. Default triangulates what it matches in the "
        "images: where too few views match, it has no start, and its case is among those that failed. Means "
        "and deviations are over the objects of the last column."
    )
    groups = group_by(records, *labels)
    table = tabulate("few_views", labels, groups, columns)
    rows = [[*row, str(len(g))] for row, g in zip(table.rows, groups.values(), strict=True)]
    counted = replace(table, headings=[*table.headings, "objects"], rows=rows)
    return Section("Quality by views", text, [counted], [chart])


def _loss(records: Sequence[Record]) -> Section:
    """Return what depth in the loss gains, on the objects that were measured with and without."""
    rows = []
    for (views, strategy), found in group_by(records, "views", "strategy").items():
        pairs = [
            {record["labels"]["depth loss"]: final_psnr(record) for record in pair}
            for pair in group_by(found, "object", "seed").values()
        ]
        gains = [
            with_loss - without
            for pair in pairs
            if (with_loss := pair.get("on")) is not None
            and (without := pair.get("off")) is not None
        ]
        if gains:
            mean = sum(gains) / len(gains)
            worst, best = f"{min(gains):+.2f}", f"{max(gains):+.2f}"
            rows.append([str(views), strategy, f"{mean:+.2f}", worst, best, str(len(gains))])
    headings = ["views", "strategy", "gain [dB]", "smallest", "largest", "objects"]
    text = (
        "PSNR with the measured depth in the loss minus PSNR without it, object by object, on views of a "
        "perfect camera."
    )
    return Section("Depth in the loss", text, [Table("depth_loss", headings, rows)])


def _early(records: Sequence[Record]) -> Section:
    columns = [
        Column("best along the run [dB]", 2, best_of_course),
        Column("at the end [dB]", 2, number("metrics", "psnr_object")),
        Column("lost at the end [dB]", 2, lost_at_the_end),
    ]
    labels = ("views", "strategy", "depth loss")
    text = (
        "Few views are learned by heart: held-out views then get worse while the training views still get "
        "better. The best of the measured steps is what a perfect early stop would keep; a real one has to "
        "hold out views to see it."
    )
    table = tabulate("early_stop", labels, group_by(records, *labels), columns)
    return Section("Stopping early", text, [table])


def _published(records: Sequence[Record]) -> Section:
    """Return our figures with three views beside those of few-shot methods."""
    few = [r for r in records if r["labels"]["views"] == LLFF_VIEWS]
    groups = group_by(few, "strategy", "depth loss").items()
    rows = [
        [_name(*key), "our objects", found.text(2)]
        for key, group in groups
        if (found := spread(group, number("metrics", "psnr_frame")))
    ]
    rows += [[name, "LLFF", f"{psnr:.2f}"] for name, psnr in LLFF_PSNR.items()]
    text = (
        "Published figures of few-shot methods with three views. They have no depth from a sensor; some take "
        "it from a network that looks at one image. They are not comparable in level: LLFF has photographs "
        "of places, taken from one side by a camera that moved a little, and counts whole images. Ours are "
        "rendered objects over white, which fills most of the frame and is easy, seen from all around, a "
        "third of a turn apart, which is harder. Read them for what is usual, not as a ranking."
    )
    headings = ["method", "recordings", "PSNR of the frame, 3 views [dB]"]
    return Section("Beside few-shot methods", text, [Table("few_shot", headings, rows)])


def _name(strategy: str, loss: str) -> str:
    return strategy if loss == "on" else f"{strategy}, no depth loss"
