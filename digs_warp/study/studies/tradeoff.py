"""What accuracy costs in time: each knob of the chain alone, and the Pareto front."""

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any, NamedTuple

from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import (
    AT_TWICE,
    Record,
    Spread,
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

# Knob -> (part of the chain, setting, values); the width also changes the height. The most important knobs
# come first.
KNOBS: dict[str, tuple[str, str, Sequence[Any]]] = {
    "iterations": ("reconstruction", "train.stop.iterations", (100, 250, 1000, 2000)),
    "frames": ("recording", "frames", (16, 24, 60)),
    "image width": ("recording", "width", (320, 640, 960)),
    "voxel size [mm]": ("reconstruction", "init.voxel_size", (16, 8, 2)),
    "initialization": ("reconstruction", "init.strategy", ("depth", "fusion", "default", "random")),
    "density control": ("reconstruction", "train.density.strategy", ("adaptive",)),
    "sensor tier": ("recording", "tier", ("truth", "law", "matcher")),
    "samples per pixel": ("recording", "samples_per_pixel", (1, 16)),
    "SH degree": ("reconstruction", "train.sh_degree", (0, 1, 2, 3)),
    "weight of depth": (
        "reconstruction",
        "train.depth_weight",
        (0.0, 0.001, 0.002, 0.015, 0.05, 0.2),
    ),
    "poses": ("reconstruction", "sfm.poses", ("sfm",)),
    "features per image": ("reconstruction", "sfm.features", (1000, 6000)),
    "pairs of images": ("reconstruction", "sfm.pairing", ("sequential",)),
}
# These only matter with estimated poses, and are compared with them.
OF_SFM = ("features per image", "pairs of images")

# Realism of the recording: shown, but not a setting to choose for its quality.
REALISM = ("sensor tier",)


def cases(objects: Objects, seeds: int = 1, iterations: int = 500) -> list[Case]:
    """Return the usual settings, then one knob turned at a time; one object after the other."""
    usual = RECONSTRUCTION | {"train.stop.iterations": iterations}
    turned = [(knob, value) for knob, (_, _, values) in KNOBS.items() for value in values]
    return [
        _case(name, recording, knob, value, seed, usual)
        for seed in range(seeds)
        for name, recording in objects.items()
        for knob, value in [(USUAL, ""), *turned]
    ]


def _case(
    name: str, scene: Mapping[str, Any], knob: str, value: Any, seed: int, usual: dict[str, Any]
) -> Case:
    recording = {**scene, **RECORDING, "seed": seed}
    reconstruction = usual | {"train.seed": seed}
    if knob != USUAL:
        part, setting, _ = KNOBS[knob]
        changes = {setting: value}
        if knob == "initialization":
            changes["init.voxel_size"] = voxel_size(value)
        if knob == "image width":
            changes["height"] = value * 9 // 16
        if knob == "voxel size [mm]":
            changes[setting] = value / 1e3
        if knob in OF_SFM:
            changes["sfm.poses"] = "sfm"
        if part == "recording":
            recording |= changes
        else:
            reconstruction |= changes
    labels = {"object": name, "knob": knob, "value": value, "seed": seed}
    return Case(labels, recording, reconstruction)


def sections(records: Sequence[Record]) -> list[Section]:
    """Return the front over all cases, and every setting beside the usual one."""
    measured = _measured(records)
    if (USUAL, "") not in measured:
        return [Section("Nothing to compare", "The case with the usual settings is missing.")]
    return [_front(_choices(measured)), _knobs(measured)]


def total_seconds(record: Record) -> float:
    """Return the seconds of the whole chain [s], without compiling kernels."""
    stages = record["seconds"].items()
    reconstruction = sum(
        s for name, s in stages if name not in ("compile kernels", "measure course")
    )
    return reconstruction + sum(record["recording_seconds"].values())


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
    usual = {_subject(r): _numbers(r) for r in records if r["labels"].get("knob") == USUAL}
    usual = {subject: pair for subject, pair in usual.items() if pair}
    if not usual:
        return {}
    levels = [sum(pair[i] for pair in usual.values()) / len(usual) for i in (0, 1)]
    double = _at_twice(records)
    found: Measured = {}
    for key, group in group_by(records, "knob", "value").items():
        pairs = [
            (n, usual[_subject(r)]) for r in group if (n := _numbers(r)) and _subject(r) in usual
        ]
        seconds = Spread.of(levels[0] * own[0] / base[0] for own, base in pairs)
        quality = Spread.of(levels[1] + own[1] - base[1] for own, base in pairs)
        if seconds and quality:
            found[key] = Worth(seconds, quality, double.get(key))
    return found


def _at_twice(records: Sequence[Record]) -> dict[tuple[Any, ...], Spread]:
    """Return the PSNR at twice the size [dB] of every setting, compared in the same way."""
    known = [(record, value) for record in records if (value := double_psnr(record)) is not None]
    usual = {_subject(r): value for r, value in known if r["labels"].get("knob") == USUAL}
    values: dict[tuple[Any, ...], list[float]] = {}
    for record, value in known:
        if _subject(record) in usual:
            key = (record["labels"].get("knob"), record["labels"].get("value"))
            values.setdefault(key, []).append(value - usual[_subject(record)])
    level = fmean(usual.values()) if usual else 0.0
    spreads = {key: Spread.of(level + gain for gain in gains) for key, gains in values.items()}
    return {key: spread for key, spread in spreads.items() if spread}


def _choices(measured: Measured) -> Measured:
    """Return the settings to choose from by time and quality."""
    return {key: values for key, values in measured.items() if key[0] not in REALISM}


def _subject(record: Record) -> tuple[Any, Any]:
    return record["labels"].get("object"), record["labels"].get("seed")


def _numbers(record: Record) -> tuple[float, float] | None:
    quality, seconds = final_psnr(record), total_seconds(record)
    return None if quality is None or not seconds else (seconds, quality)


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
    rows = []
    for knob in KNOBS:
        turned = {key: value for key, value in measured.items() if key[0] == knob}
        base = measured.get(("poses", "sfm") if knob in OF_SFM else (USUAL, ""))
        if not turned or base is None:
            continue
        rows.append([knob, f"{_usual_value(knob)} ({USUAL})", *base.cells(), "", ""])
        for key, worth in turned.items():
            seconds = worth.seconds.mean - base.seconds.mean
            quality = worth.quality.mean - base.quality.mean
            rows.append([knob, str(key[1]), *worth.cells(), f"{seconds:+.1f}", f"{quality:+.2f}"])
    text = (
        "One setting at a time, the most important first, compared with the usual settings; those of "
        "structure from motion with estimated poses. The sensor tier buys realism, not quality."
    )
    headings = ["setting", "value", "seconds", "PSNR [dB]", f"{AT_TWICE} [dB]"]
    headings += ["seconds more", "dB more"]
    return Section("Each setting alone", text, [Table("knobs", headings, rows)])


def _usual_value(knob: str) -> Any:
    """Return the usual value of a knob."""
    from digs_warp.pipeline.reconstruct import ReconstructConfig
    from digs_warp.sim.config import SimulateConfig

    part, setting, _ = KNOBS[knob]
    changed = RECORDING if part == "recording" else RECONSTRUCTION
    if setting == "init.voxel_size":
        return 1e3 * VOXEL
    if setting in changed:
        return changed[setting]
    value: Any = SimulateConfig() if part == "recording" else ReconstructConfig()
    for name in setting.split("."):
        value = getattr(value, name)
    return value


def name_of(key: tuple[Any, ...]) -> str:
    """Return what was turned, in words, for a (knob, value)."""
    return USUAL if key[0] == USUAL else f"{key[0].split(' [')[0]} {key[1]}"
