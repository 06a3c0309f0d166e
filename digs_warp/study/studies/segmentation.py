"""Masks that are wrong: leaks, cut-off parts and shifted borders (the paper's figure 6), by strategy."""

from collections.abc import Sequence

from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import Record, group_by, spread
from digs_warp.study.page import Section
from digs_warp.study.scenes import objects
from digs_warp.study.table import Table

ERRORS = (0.0, 1.0, 2.0, 4.0)
STRATEGIES = ("highdepth", "fusion", "default")


def cases(objects_count: int = 1, seeds: int = 1, iterations: int = 1000) -> list[Case]:
    """Return the cases; 0 spoils nothing."""
    return [
        Case(
            labels={"object": name, "mask error": error, "strategy": strategy, "seed": seed},
            recording=scene | {"frames": 40, "width": 480, "height": 270, "seed": seed},
            reconstruction={
                **{"segment.masks": "degraded", "segment.mask_error": error},
                **{"segment.mask_seed": seed, "init.strategy": strategy},
                **{"train.stop.iterations": iterations, "train.seed": seed},
            },
        )
        for seed in range(seeds)
        for name, scene in objects(objects_count).items()
        for error in ERRORS
        for strategy in STRATEGIES
    ]


def sections(records: Sequence[Record]) -> list[Section]:
    """Return quality and geometry by how wrong the masks are."""
    rows = []
    curves = []
    for (strategy,), found in group_by(records, "strategy").items():
        points = []
        for (error,), group in group_by(found, "mask error").items():
            quality = spread(group, lambda r: r["yardstick"].get("psnr"))
            masked = spread(group, lambda r: r["yardstick"].get("psnr_masked"))
            chamfer = spread(
                group, lambda r: 1e3 * r["surface"]["points"]["chamfer"] if r["surface"] else None
            )
            texts = [value.text(2) if value else "" for value in (quality, masked, chamfer)]
            rows.append([strategy, f"{error:g}", *texts])
            if quality:
                points.append((error, quality.mean))
        curves.append(Curve(strategy, [x for x, _ in points], [y for _, y in points]))
    headings = [
        "strategy",
        "mask error",
        "PSNR [dB]",
        "PSNR in the mask [dB]",
        "points: Chamfer [mm]",
    ]
    text = (
        "Training masks are spoiled, the views that measure are not. What a mask lets in beside the object "
        "is trained like the object; depth tells it apart only where it lies behind."
    )
    chart = Chart(
        *("segmentation", "What wrong masks cost", curves),
        *("mask error", "PSNR on views of a perfect camera [dB]"),
    )
    return [Section("Wrong masks", text, [Table("segmentation", headings, rows)], [chart])]
