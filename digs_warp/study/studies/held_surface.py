"""What holding the surface at the measured depth costs: quality against millimeters, for every weight."""

from collections.abc import Sequence

from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine.records import (
    Column,
    Groups,
    Record,
    final_psnr,
    group_by,
    number,
    spread,
)
from digs_warp.study.page import Section
from digs_warp.study.table import Table
from digs_warp.train.config import DEPTH_WEIGHT

KNOB, SETTING = "weight of depth", "train.depth_weight"
# Beside the default.
WEIGHTS = (0.0, 0.001, 0.002, 0.015, 0.05, 0.2)

ACCURACY = number("results", "surface", "accuracy", factor=1e3)
COLUMNS = (
    Column("PSNR on the object [dB]", 2, final_psnr),
    Column("accuracy [mm]", 2, ACCURACY),
    Column("completeness [mm]", 2, number("results", "surface", "completeness", factor=1e3)),
    Column("adherence [mm]", 2, number("results", "adherence", factor=1e3)),
)


def surface_sections(records: Sequence[Record]) -> list[Section]:
    """Return the curve and the table over the weights of depth; nothing where none was measured."""
    chosen = [r for r in records if r["labels"].get("knob") in ("usual", KNOB)]
    groups = group_by([{**r, "labels": {"weight": _weight(r)}} for r in chosen], "weight")
    known: Groups = {key: groups[key] for key in sorted(groups) if spread(groups[key], ACCURACY)}
    if len(known) < 2:
        return []
    points = [(spread(found, ACCURACY), spread(found, final_psnr)) for found in known.values()]
    curve = Curve(
        KNOB,
        [accuracy.mean for accuracy, _ in points if accuracy],
        [quality.mean for _, quality in points if quality],
        notes=[f"{weight:g}" for (weight,) in known],
    )
    chart = Chart(
        *("held_surface", "Quality against the accuracy of the surface", [curve]),
        *("mean distance of the surface to the true one [mm]", "PSNR on the object [dB]"),
    )
    rows = [
        [f"{weight:g}", *(column.text(found) for column in COLUMNS)]
        for (weight,), found in known.items()
    ]
    headings = [KNOB, *(column.heading for column in COLUMNS)]
    text = (
        "The training may move the surface off the measured depth if the images then fit better. The weight "
        "of the depth says how much that counts. Distances are those of the rendered surface to the true "
        "mesh; adherence is its median distance to the measured depth."
    )
    return [
        Section("Images against geometry", text, [Table("held_surface", headings, rows)], [chart])
    ]


def _weight(record: Record) -> float:
    return float(record["reconstruction"].get(SETTING, DEPTH_WEIGHT))
