"""The value of each component of the initialization, which the paper leaves to future work (its section 5).

Each case changes one thing in the paper's Highdepth: it removes a component, or adds one of ours. Poses are
estimated, as in the paper. Spoilt masks imitate a segmentation that fails now and then; true masks show what
the other filters contribute.
"""

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import (
    Column,
    Record,
    Value,
    at_iteration,
    final_psnr,
    group_by,
    number,
)
from digs_warp.study.page import Section
from digs_warp.study.scenes import VOXEL, Objects
from digs_warp.study.table import Table

RECORDING: dict[str, Any] = {"frames": 48, "width": 480, "height": 270, "samples_per_pixel": 4}

SPOILT, TRUE = "spoilt", "true"
# Size of the errors in the masks.
MASKS: dict[str, float | None] = {SPOILT: 1.0, TRUE: None}

ITERATIONS = (100, 300, 1000)

# No two measurements share a voxel of this size [m]; about as many points are drawn as the usual grid keeps.
NO_GRID: dict[str, Any] = {"init.voxel_size": 1e-4, "init.max_points": 60_000}
FEW_POINTS = 20_000

RECIPE = "paper's Highdepth"
AGAIN = "the same, other order of views"
PAPER: dict[str, Any] = {"init.visibility_check": False, "init.voxel_size": VOXEL}

VARIANTS: dict[str, dict[str, Any]] = {
    RECIPE: {},
    AGAIN: {},
    "no masks": {"init.mask_filter": False},
    "no edge filter": {"init.edge_filter": False},
    "no k-means": {"init.foreground_filter": False},
    "k-means, equal weights": {"init.background_weight": 1.0},
    "mean scale, not mode": {"init.scale": "mean"},
    "no voxel grid": NO_GRID,
    "+ visibility check": {"init.visibility_check": True},
    "+ flat Gaussians": {"init.shape": "flat"},
    f"+ voxels for {FEW_POINTS:,} points": {
        "init.voxel_size": None,
        "init.target_points": FEW_POINTS,
    },
}


def cases(objects: Objects, seeds: int = 1, iterations: int = 1000) -> list[Case]:
    """Return the cases: all variants with spoilt masks, each on all objects, then with true ones."""
    return [
        _case(name, scene, masks, variant, seed, iterations)
        for seed in range(seeds)
        for masks in MASKS
        for variant in VARIANTS
        for name, scene in objects.items()
    ]


def _case(
    name: str, scene: Mapping[str, Any], masks: str, variant: str, seed: int, iterations: int
) -> Case:
    # AGAIN uses an order of the views that no other repetition has.
    seeds = {"train.seed": 1000 + seed if variant == AGAIN else seed}
    return Case(
        labels={"object": name, "masks": masks, "variant": variant, "seed": seed},
        recording={**scene, **RECORDING, "seed": seed},
        reconstruction={"sfm.poses": "sfm", "train.stop.iterations": iterations}
        | (PAPER | VARIANTS[variant] | seeds),
        mask_error=MASKS[masks],
    )


# Columns without the difference to the recipe beside the value.
PLAIN = ("points", "scale error [%]")


def _columns(records: Sequence[Record]) -> list[Column]:
    """Return the columns; iterations that no record reached have none."""
    reached = _reached(records)
    points = ("surface", "points")
    columns: list[tuple[str, int, Value]] = [
        ("points", 0, number("results", "initial_points")),
        ("Chamfer [mm]", 2, number(*points, "chamfer", factor=1e3)),
        ("F-score at 5 mm [%]", 1, number(*points, "f_score", factor=1e2)),
        ("scale error [%]", 3, number("scale_error", factor=1e2)),
        *((f"PSNR after {i} [dB]", 2, at_iteration(i, "psnr_object")) for i in reached),
        *((f"SSIM after {i}", 4, at_iteration(i, "ssim_object")) for i in reached),
        ("PSNR, perfect camera [dB]", 2, final_psnr),
    ]
    return [Column(*column, deviation=False) for column in columns]


def _reached(records: Sequence[Record]) -> list[int]:
    return [i for i in ITERATIONS if any(map(at_iteration(i, "psnr_object"), records))]


def sections(records: Sequence[Record]) -> list[Section]:
    """Return a table and a chart for each kind of masks."""
    found = group_by(records, "masks")
    return [_of_masks(masks, found[masks,]) for masks in MASKS if (masks,) in found]


def _of_masks(masks: str, records: Sequence[Record]) -> Section:
    titles = {SPOILT: "With typical mask errors", TRUE: "With true masks"}
    texts = {
        SPOILT: "Masks with wrong borders, leaks into the background and missing pieces, for both the "
        "initialization and the training. The test views have true masks.",
        TRUE: "The error-free masks of the simulator.",
    }
    text = (
        f"{texts[masks]} In brackets: the difference from the first row of the same object. "
        "PSNR and SSIM are measured on held-out views; the last column on views of a perfect camera. "
        f"{_findings(records)}"
    )
    columns = _columns(records)
    headings = ["object", "variant", *(column.heading for column in columns)]
    rows = [
        [name, variant, *_cells(columns, group, by_variant.get((RECIPE,), []))]
        for (name,), found in group_by(records, "object").items()
        for by_variant in [group_by(found, "variant")]
        for (variant,), group in by_variant.items()
    ]
    table = Table(f"ablation_{masks}", headings, rows)
    return Section(titles[masks], text, [table], [_chart(masks, records)])


def _cells(
    columns: Sequence[Column], group: Sequence[Record], recipe: Sequence[Record]
) -> list[str]:
    cells = []
    for column in columns:
        text = column.text(group)
        if column.heading not in PLAIN and group is not recipe:
            difference = column.difference(group, recipe)
            text += f" ({difference})" if difference else ""
        cells.append(text)
    return cells


def _differences(records: Sequence[Record], value: Value) -> dict[str, list[float]]:
    """Return by variant the differences to the recipe with the same object, masks and seed."""
    same = ("object", "masks", "seed")
    usual = {
        tuple(record["labels"][label] for label in same): value(record)
        for record in records
        if record["labels"]["variant"] == RECIPE
    }
    found: dict[str, list[float]] = {}
    for record in records:
        here, there = value(record), usual.get(tuple(record["labels"][label] for label in same))
        if here is not None and there is not None and record["labels"]["variant"] != RECIPE:
            found.setdefault(record["labels"]["variant"], []).append(here - there)
    return found


def _findings(records: Sequence[Record]) -> str:
    """Name the variants that change more than chance does, and how much chance changes."""
    sentences = []
    for when, value in (
        (f"after {ITERATIONS[0]} steps", at_iteration(ITERATIONS[0], "psnr_object")),
        ("at the end", final_psnr),
    ):
        differences = _differences(records, value)
        chance = fmean(map(abs, differences.pop(AGAIN, [0.0])))
        means = {variant: fmean(found) for variant, found in differences.items()}
        ranked = sorted(means, key=lambda variant: means[variant])
        worse = [f"{v} ({means[v]:+.2f} dB)" for v in ranked if means[v] < -chance]
        better = [f"{v} ({means[v]:+.2f} dB)" for v in ranked[::-1] if means[v] > chance]
        for what, names in (("Lost", worse), ("Gained", better)):
            if names:
                sentences.append(f"{what} most {when}: {', '.join(names[:3])}.")
        if chance:
            sentences.append(
                f"A different order of the views alone changes {chance:.2f} dB then: smaller differences "
                "are not significant."
            )
    return " ".join(sentences)


def _chart(masks: str, records: Sequence[Record]) -> Chart:
    measured = {record["labels"]["variant"] for record in records}
    names = [variant for variant in VARIANTS if variant in measured and variant != RECIPE]
    curves = []
    for iteration in _reached(records):
        found = _differences(records, at_iteration(iteration, "psnr_object"))
        known = [(fmean(found[name]), row) for row, name in enumerate(names) if name in found]
        label = f"after {iteration} steps"
        curves.append(Curve(label, [x for x, _ in known], [y for _, y in known], line=False))
    title = f"Difference from the {RECIPE}, {masks} masks"
    x_label = "PSNR of held-out views minus that of the recipe [dB]"
    return Chart(f"ablation_{masks}", title, curves, x_label, "", rows=names)
