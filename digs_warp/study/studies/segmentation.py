"""Wrong masks by strategy: leaks, missing parts and shifted borders (the paper's figure 6)."""

from collections.abc import Sequence

from digs_warp.study.charts import Chart
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import (
    Column,
    Record,
    curve,
    final_psnr,
    group_by,
    number,
    tabulate,
)
from digs_warp.study.page import Section
from digs_warp.study.scenes import objects, voxel_size

ERRORS = (0.0, 1.0, 2.0, 4.0)
STRATEGIES = ("highdepth", "fusion", "default")


def cases(objects_count: int = 1, seeds: int = 1, iterations: int = 1000) -> list[Case]:
    """Return the cases; error 0 leaves the masks as they are."""
    return [
        Case(
            labels={"object": name, "mask error": error, "strategy": strategy, "seed": seed},
            recording=scene | {"frames": 40, "width": 480, "height": 270, "seed": seed},
            reconstruction={
                **{"segment.masks": "degraded", "segment.mask_error": error},
                **{"segment.mask_seed": seed, "init.strategy": strategy},
                "init.voxel_size": voxel_size(strategy),
                **{"train.stop.iterations": iterations, "train.seed": seed},
            },
        )
        for seed in range(seeds)
        for name, scene in objects(objects_count).items()
        for error in ERRORS
        for strategy in STRATEGIES
    ]


def sections(records: Sequence[Record]) -> list[Section]:
    """Return quality and geometry by the strength of the mask errors."""
    columns = [
        Column("PSNR, object [dB]", 2, final_psnr),
        Column("PSNR, frame [dB]", 2, number("yardstick", "psnr_frame")),
        Column("points: Chamfer [mm]", 2, number("surface", "points", "chamfer", factor=1e3)),
    ]
    labels = ("strategy", "mask error")
    groups = group_by(records, *labels)
    by_strategy = dict.fromkeys(strategy for strategy, _ in groups)
    rows = {key: groups[key] for s in by_strategy for key in groups if key[0] == s}
    curves = [
        curve(s, {error: found for (name, error), found in rows.items() if name == s}, final_psnr)
        for s in by_strategy
    ]
    text = (
        "The training masks are spoiled, those of the test views are not. Background that leaks into a mask "
        "is trained like the object; depth can only separate it where it lies behind the object."
    )
    chart = Chart(
        *("segmentation", "Loss from wrong masks", curves),
        *("mask error", "PSNR on views of a perfect camera [dB]"),
    )
    table = tabulate("segmentation", labels, rows, columns)
    return [Section("Wrong masks", text, [table], [chart])]
