"""What accuracy costs in time: each knob of the chain alone, and the Pareto front."""

from collections.abc import Sequence
from statistics import fmean
from typing import Any, NamedTuple

from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import (
    AT_TWICE,
    Record,
    Spread,
    Value,
    double_psnr,
    final_psnr,
    group_by,
    pareto_front,
)
from digs_warp.study.page import Section
from digs_warp.study.scenes import VOXEL, Objects, voxel_size
from digs_warp.study.table import Table

# The point that every knob starts from.
RECORDING: dict[str, Any] = {"frames": 40, "width": 480, "height": 270, "samples_per_pixel": 4}
RECONSTRUCTION: dict[str, Any] = {"train.stop.iterations": 500, "init.voxel_size": VOXEL}
USUAL = "usual"

# Knob -> (part of the chain, setting, usual value, values); the width also changes the height. The most
# important knobs come first.
KNOBS: dict[str, tuple[str, str, Any, Sequence[Any]]] = {
    "iterations": ("reconstruction", "train.stop.iterations", 500, (100, 250, 1000, 2000)),
    "frames": ("recording", "frames", 40, (16, 24, 60)),
    "image width": ("recording", "width", 480, (320, 640, 960)),
    "voxel size [mm]": ("reconstruction", "init.voxel_size", 4, (16, 8, 2)),
    "initialization": (
        *("reconstruction", "init.strategy", "highdepth"),
        ("depth", "fusion", "default", "random"),
    ),
    "density control": ("reconstruction", "train.density.strategy", "fixed", ("adaptive",)),
    "sensor tier": ("recording", "tier", "guided", ("truth", "law", "matcher")),
    "samples per pixel": ("recording", "samples_per_pixel", 4, (1, 16)),
    "SH degree": ("reconstruction", "train.sh_degree", "auto", (0, 1, 2, 3)),
    "weight of depth": ("reconstruction", "train.depth_weight", 0.008, (0.0, 0.05)),
    "poses": ("reconstruction", "sfm.poses", "capture", ("sfm",)),
}


def cases(objects: Objects, seeds: int = 1, iterations: int = 500) -> list[Case]:
    """Return the usual settings, then one knob turned at a time; one object after the other."""
    usual = RECONSTRUCTION | {"train.stop.iterations": iterations}
    turned = [(knob, value) for knob, (*_, values) in KNOBS.items() for value in values]
    return [
        Case(
            {"object": name, "knob": knob, "value": value, "seed": seed},
            {**scene, **RECORDING, "seed": seed, **_turned("recording", knob, value)},
            usual | {"train.seed": seed} | _turned("reconstruction", knob, value),
        )
        for seed in range(seeds)
        for name, scene in objects.items()
        for knob, value in [(USUAL, ""), *turned]
    ]


def _turned(part: str, knob: str, value: Any) -> dict[str, Any]:
    """Return what a knob changes in a part of the chain."""
    if knob == USUAL or KNOBS[knob][0] != part:
        return {}
    changes = {KNOBS[knob][1]: value}
    if knob == "initialization":
        changes["init.voxel_size"] = voxel_size(value)
    if knob == "image width":
        changes["height"] = value * 9 // 16
    if knob == "voxel size [mm]":
        changes["init.voxel_size"] = value / 1e3
    return changes


def sections(records: Sequence[Record]) -> list[Section]:
    """Return the front over all cases, and every setting beside the usual one."""
    measured = _measured(records)
    if (USUAL, "") not in measured:
        return [Section("Nothing to compare", "The case with the usual settings is missing.")]
    # Realism is shown, but no setting to choose for its quality.
    choices = {key: worth for key, worth in measured.items() if key[0] != "sensor tier"}
    return [_front(choices), _knobs(measured)]


def total_seconds(record: Record) -> float:
    """Return the seconds of the whole chain [s], without compiling kernels and measuring its course."""
    stages = record["seconds"] | {"compile kernels": 0.0, "measure course": 0.0}
    return sum(stages.values()) + sum(record["recording_seconds"].values())


class Worth(NamedTuple):
    """What a setting costs and gives: seconds, PSNR [dB], and that at twice the size if it is known."""

    seconds: Spread
    quality: Spread
    double: Spread | None

    def cells(self) -> list[str]:
        """Return seconds and PSNR as tables show them."""
        double = self.double.text(2) if self.double else ""
        return [self.seconds.text(1), self.quality.text(2), double]


Measured = dict[tuple[Any, ...], Worth]


def _measured(records: Sequence[Record]) -> Measured:
    """Return mean time and quality of every setting.

    A time budget may have skipped an object for some settings, or the machine was busier during some cases.
    So each setting is compared with the usual one on the objects that both have: the ratio of seconds and the
    difference of PSNR. Their means are applied to the means of the usual settings.
    """
    usual = {_subject(r): r for r in records if r["labels"].get("knob") == USUAL}

    def compared(group: Sequence[Record], value: Value, ratio: bool = False) -> Spread | None:
        base = {subject: v for subject, r in usual.items() if (v := value(r)) is not None}
        own = [(v, base[_subject(r)]) for r in group if _subject(r) in base if (v := value(r))]
        level = fmean(base.values()) if base else 0.0
        return Spread.of(level * v / b if ratio else level + v - b for v, b in own)

    found: Measured = {}
    for key, group in group_by(records, "knob", "value").items():
        seconds, quality = compared(group, total_seconds, ratio=True), compared(group, final_psnr)
        if seconds and quality:
            found[key] = Worth(seconds, quality, compared(group, double_psnr))
    return found


def _subject(record: Record) -> tuple[Any, Any]:
    return record["labels"].get("object"), record["labels"].get("seed")


def _front(measured: Measured) -> Section:
    keys = list(measured)
    points = [(worth.seconds.mean, worth.quality.mean) for worth in measured.values()]
    front = pareto_front(points)
    rows = [[name_of(keys[i]), *measured[keys[i]].cells()] for i in front]
    curves = [
        Curve("all settings", [x for x, _ in points], [y for _, y in points], line=False),
        Curve(
            "nothing is both faster and better",
            [points[i][0] for i in front],
            [points[i][1] for i in front],
            notes=[name_of(keys[i]) for i in front],
        ),
    ]
    chart = Chart(
        *("front", "Quality against time of the whole chain", curves),
        *("seconds of the whole chain", "PSNR on views of a perfect camera [dB]"),
        log_x=True,
    )
    text = (
        "Every point is one setting, averaged over the objects: seconds from the recording to the Gaussians, "
        "and PSNR on the same views of a perfect camera along a walk that no recording took. One brightness "
        "and white balance are fitted to all views before, because a camera that adapts leaves them open. "
        "Each object is compared with its own usual settings, which therefore have no spread; ± shows how "
        f"much objects differ in the cost and gain of a setting. {AT_TWICE.capitalize()}: the same in views "
        "from half the distance, where a scene that only suits the size of its photographs falls apart."
    )
    table = Table("front", ["setting", "seconds", "PSNR [dB]", f"{AT_TWICE} [dB]"], rows)
    return Section("What is worth its time", text, [table], [chart])


def _knobs(measured: Measured) -> Section:
    """Return every setting turned alone, and what it costs and gains."""
    base = measured[USUAL, ""]
    rows = []
    for knob in KNOBS:
        turned = {key: value for key, value in measured.items() if key[0] == knob}
        if turned:
            rows.append([knob, f"{KNOBS[knob][2]} ({USUAL})", *base.cells(), "", ""])
        for key, worth in turned.items():
            seconds = worth.seconds.mean - base.seconds.mean
            quality = worth.quality.mean - base.quality.mean
            rows.append([knob, str(key[1]), *worth.cells(), f"{seconds:+.1f}", f"{quality:+.2f}"])
    text = (
        "One setting at a time, the most important first, compared with the usual settings. The sensor tier "
        "buys realism, not quality."
    )
    headings = ["setting", "value", "seconds", "PSNR [dB]", f"{AT_TWICE} [dB]"]
    headings += ["seconds more", "dB more"]
    return Section("Each setting alone", text, [Table("knobs", headings, rows)])


def name_of(key: tuple[Any, ...]) -> str:
    """Return what was turned, in words, for a (knob, value)."""
    return USUAL if key[0] == USUAL else f"{key[0].split(' [')[0]} {key[1]}"
