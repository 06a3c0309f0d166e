"""The paper's tables 2 to 4: five initializations, quality along the iterations, time of every stage."""

from collections.abc import Sequence
from typing import Any

from digs_warp.study.engine.case import Case
from digs_warp.study.engine.charts import Chart, Curve
from digs_warp.study.engine.page import Section, Table
from digs_warp.study.engine.records import Record, at_iteration, group_by, spread
from digs_warp.study.studies.scenes import objects

STRATEGIES = ("default", "depth", "highdepth", "fusion", "random")
ITERATIONS = (100, 300, 500, 1000, 3000, 7000, 12000)

# Table 2 of the paper (mean over both of its data sets): PSNR [dB] and SSIM by iteration.
PAPER_PSNR = {
    "default": {100: 17.553, 500: 23.206, 1000: 24.540, 3000: 25.697, 7000: 26.675, 12000: 27.393},
    "depth": {100: 22.673, 500: 24.376, 1000: 24.901, 3000: 25.848, 7000: 26.764, 12000: 27.519},
    "highdepth": {
        100: 23.629,
        500: 24.922,
        1000: 25.235,
        3000: 25.986,
        7000: 26.860,
        12000: 27.581,
    },
    "fusion": {100: 22.885, 500: 24.711, 1000: 25.130, 3000: 25.963, 7000: 26.811, 12000: 27.552},
    "random": {100: 8.466, 500: 16.542, 1000: 22.088, 3000: 25.207, 7000: 26.563, 12000: 27.392},
}
STAGES = ("structure from motion", "scale", "initialize", "train")

# Poses are estimated, as in the paper. Density control is that of 3DGS for all five.
RECONSTRUCTION: dict[str, Any] = {
    "sfm.poses": "sfm",
    "sfm.double_size": True,
    "init.voxel_unit": "object",
    "train.density": "default",
}


def cases(objects_count: int = 4, seeds: int = 1, iterations: int = 1000) -> list[Case]:
    """Return the cases, one seed after the other; an object's five strategies follow each other."""
    return [
        Case(
            labels={"object": name, "strategy": strategy, "seed": seed},
            recording=recording | {"frames": 60, "width": 640, "height": 360, "seed": seed},
            reconstruction=RECONSTRUCTION
            | {"init.strategy": strategy, "train.iterations": iterations, "train.seed": seed},
        )
        for seed in range(seeds)
        for name, recording in objects(objects_count).items()
        for strategy in STRATEGIES
    ]


def sections(records: Sequence[Record]) -> list[Section]:
    """Return quality along the iterations, the geometry of the points, and the times."""
    return [_quality(records), _geometry(records), _times(records)]


def _quality(records: Sequence[Record]) -> Section:
    groups = {key[0]: found for key, found in group_by(records, "strategy").items()}
    reached = [i for i in ITERATIONS if any(at_iteration(r, i, "psnr") for r in records)]
    tables = [
        _quality_table(groups, reached, metric, unit, decimals)
        for metric, unit, decimals in (("psnr", " [dB]", 2), ("ssim", "", 4))
    ]
    curves = []
    for strategy, found in groups.items():
        values = [spread(found, lambda r, i=i: at_iteration(r, i, "psnr")) for i in reached]
        points = [(i, v) for i, v in zip(reached, values, strict=True) if v]
        curves.append(
            Curve(
                strategy,
                [i for i, _ in points],
                [v.mean for _, v in points],
                spread=[v.deviation for _, v in points],
            )
        )
    chart = Chart(
        *("psnr", "Held-out quality along the iterations", curves, "iterations", "PSNR [dB]"),
        log_x=True,
    )
    text = (
        "Mean over objects and seeds, with the standard deviation. The paper's figures (its table 2) are "
        "from other objects, at 1600 px and with other views held out: compare the order, not the level."
    )
    return Section("Quality", text, tables, [chart])


def _quality_table(
    groups: dict[Any, list[Record]], reached: Sequence[int], metric: str, unit: str, decimals: int
) -> Table:
    rows = []
    for strategy, found in groups.items():
        values = [spread(found, lambda r, i=i: at_iteration(r, i, metric)) for i in reached]
        row = [strategy, *(v.text(decimals) if v else "" for v in values)]
        if metric == "psnr":
            paper = [PAPER_PSNR.get(strategy, {}).get(i) for i in reached]
            row += [f"{value:.2f}" if value else "" for value in paper]
        rows.append(row)
    headings = [f"{metric.upper()}{unit}", *map(str, reached)]
    if metric == "psnr":
        headings += [f"paper {i}" for i in reached]
    return Table(metric, headings, rows)


def _geometry(records: Sequence[Record]) -> Section:
    rows = []
    for (strategy,), found in group_by(records, "strategy").items():
        row = [strategy, _count(found, "initial_points"), _count(found, "gaussians")]
        for what in ("points", "gaussians"):
            for name in ("chamfer", "accuracy_median"):
                value = spread(found, lambda r, w=what, n=name: _surface(r, w, n))
                row.append(value.text(1) if value else "")
            value = spread(found, lambda r, w=what: r["surface"].get(w, {}).get("f_score"))
            row.append(value.text(3) if value else "")
        rows.append(row)
    headings = ["strategy", "points", "Gaussians"]
    for what in ("points", "centres"):
        headings += [f"{what}: Chamfer [mm]", "median [mm]", "F-score at 5 mm"]
    text = (
        "How far points and centres of the Gaussians lie from the true surface, and how much of it they "
        "cover: what the paper's figure 7 shows, in numbers. Parts that no camera saw count as missing."
    )
    return Section("Geometry", text, [Table("geometry", headings, rows)])


def _times(records: Sequence[Record]) -> Section:
    rows = []
    for (strategy,), found in group_by(records, "strategy").items():
        row = [strategy]
        for stage in STAGES:
            value = spread(found, lambda r, s=stage: r["seconds"].get(s))
            row.append(value.text(1) if value else "")
        rows.append(row)
    headings = ["strategy", *(f"{stage} [s]" for stage in STAGES)]
    text = (
        "Seconds of each stage, as in the paper's table 4. Compiling kernels is not counted; structure from "
        "motion is done once for each recording."
    )
    return Section("Times", text, [Table("times", headings, rows)])


def _count(records: Sequence[Record], name: str) -> str:
    value = spread(records, lambda r: r["results"].get(name))
    return f"{value.mean:,.0f}" if value else ""


def _surface(record: Record, what: str, name: str) -> float | None:
    value = record["surface"].get(what, {}).get(name)
    return None if value is None else 1e3 * value
