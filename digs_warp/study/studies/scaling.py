"""How time and memory of the chain grow with frames, pixels, splats and threads, and plans from that."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import Record
from digs_warp.study.fit import fit_nonnegative
from digs_warp.study.page import Section
from digs_warp.study.scenes import objects
from digs_warp.study.table import Table

BASE: dict[str, Any] = {"frames": 32, "width": 480, "voxel": 0.005}
# One varies at a time; widths [px] at 16:9, voxels [m] set the number of splats.
CURVES: dict[str, Sequence[Any]] = {
    "frames": (16, 64, 128),
    "width": (320, 800, 1280),
    "voxel": (0.01, 0.003, 0.002),
}
ONE_THREAD = "one thread"

# The longest image side that is used for feature detection.
FEATURE_WIDTH = SfmConfig.feature_size
SEARCHED = f"frame pixels up to {FEATURE_WIDTH} wide"

# The seconds of each stage, and the peak memory [MB], are sums of these terms with fitted coefficients >= 0.
LAWS: dict[str, tuple[str, ...]] = {
    "render": ("frames", "frame pixels"),
    # Each new frame refines all earlier ones again.
    "structure from motion": ("frames", "pairs of frames", SEARCHED),
    "initialize": ("frames", "frame pixels", "splats"),
    "train": ("steps", "step pixels", "step splats"),
    "memory": ("1", "frame pixels", "pixels", "splats"),
}
# Terms that are not counted in millions.
SINGLE = {
    "1": ("always", 1.0),
    "frames": ("per frame", 1.0),
    "pairs of frames": ("per pair of frames", 1.0),
    "steps": ("per step", 1.0),
}
# Stages that work on one frame at a time.
PER_FRAME = ("render", "initialize")


@dataclass(frozen=True)
class Load:
    """The work of one run of the chain."""

    name: str
    frames: int
    width: int
    height: int
    splats: int
    steps: int

    def counts(self) -> dict[str, float]:
        """Return the terms of the laws."""
        pixels = float(self.width * self.height)
        small = pixels * min(1.0, FEATURE_WIDTH / self.width) ** 2
        return {
            "1": 1.0,
            "frames": self.frames,
            "pixels": pixels,
            "splats": self.splats,
            "pairs of frames": self.frames * (self.frames - 1) / 2,
            "steps": self.steps,
            "frame pixels": self.frames * pixels,
            SEARCHED: self.frames * small,
            "step pixels": self.steps * pixels,
            "step splats": float(self.steps) * self.splats,
        }


PLANS = (
    Load("a quick look", 60, 640, 360, 50_000, 1000),
    Load("a finer look", 100, 1280, 720, 200_000, 3000),
    Load("the paper's runs", 200, 1600, 900, 200_000, 12_000),
    Load("all of a 2K recording", 200, 2208, 1242, 1_000_000, 12_000),
)


def cases(objects_count: int = 1, seeds: int = 1, iterations: int = 200) -> list[Case]:
    """Return the base case, the base case on one thread, and one size changed at a time.

    Each has its own walk: a recording or structure from motion of two cases would be measured only once.
    """
    settings: list[tuple[str, dict[str, Any], int | None]] = [("base", BASE, None)]
    settings.append((ONE_THREAD, BASE, 1))
    settings += [(c, BASE | {c: value}, None) for c, values in CURVES.items() for value in values]
    return [
        Case(
            labels={"object": name, "curve": curve, **sizes, "seed": seed},
            recording={
                **scene,
                **{"frames": sizes["frames"], "width": sizes["width"]},
                "seed": seed * len(settings) + number,
                **{"height": sizes["width"] * 9 // 16, "samples_per_pixel": 4},
            },
            reconstruction={
                **{"sfm.poses": "sfm", "sfm.pairing": "sequential"},
                **{"init.voxel_size": sizes["voxel"], "train.seed": seed},
                **{"train.stop.iterations": iterations},
            },
            threads=threads,
        )
        for seed in range(seeds)
        for name, scene in objects(objects_count).items()
        for number, (curve, sizes, threads) in enumerate(settings)
    ]


def sections(records: Sequence[Record]) -> list[Section]:
    """Return the measurements with the fitted laws, the gain from threads, and plans."""
    usual = [r for r in records if r["labels"]["curve"] != ONE_THREAD]
    if not usual:
        return [Section("Nothing to fit", "Only cases on one thread were measured.")]
    laws = {
        stage: fit(usual, stage, terms)
        for stage, terms in LAWS.items()
        if any(value_of(record, stage) for record in usual)
    }
    return [_laws(laws), _measured(usual, laws), _threads(records), _plans(laws)]


@dataclass(frozen=True)
class Law:
    """value = sum of coefficient * count; ``miss`` is the median relative error over the measurements."""

    coefficients: dict[str, float]
    miss: float

    def at(self, load: Load) -> float:
        """Return seconds, or MB, of a load."""
        counts = load.counts()
        return sum(value * counts[term] for term, value in self.coefficients.items())


def fit(records: Sequence[Record], stage: str, terms: Sequence[str]) -> Law:
    """Fit a law to the records that have the stage, at least one; the error that is minimized is relative."""
    return fit_values([(r, value) for r in records if (value := value_of(r, stage))], terms)


def fit_values(measured: Sequence[tuple[Record, float]], terms: Sequence[str]) -> Law:
    """Fit a law to a value > 0 of each of some records, at least one."""
    known = [(load_of(record), value) for record, value in measured]
    counts = np.array([[load.counts()[term] for term in terms] for load, _ in known], np.float64)
    costs, misses = fit_nonnegative(counts, np.array([value for _, value in known]))
    return Law(dict(zip(terms, map(float, costs), strict=True)), float(np.median(misses)))


def load_of(record: Record) -> Load:
    """Return the work of a case."""
    recording, results = record["recording"], record["results"]
    return Load(
        *("measured", recording["frames"], recording["width"], recording["height"]),
        *(results["gaussians"], record["reconstruction"]["train.stop.iterations"]),
    )


def value_of(record: Record, stage: str) -> float | None:
    """Return the seconds of a stage, or for "memory" the peak [MB]."""
    if stage == "memory":
        return record["memory_mb"]
    return record["recording_seconds"].get(stage, record["seconds"].get(stage))


def _laws(laws: dict[str, Law]) -> Section:
    rows = []
    for stage, law in laws.items():
        unit = "MB" if stage == "memory" else "s"
        for term, value in law.coefficients.items():
            per, factor = SINGLE.get(term, (f"per million {term}", 1e6))
            rows.append([stage, per, f"{factor * value:.4g} {unit}", f"{100 * law.miss:.0f} %"])
    text = (
        "Each law is a sum of counts, fitted to the measurements without negative coefficients. A zero means "
        "that the term is not visible at these sizes. The last column is the median error of the law."
    )
    headings = ["stage", "term", "costs", "median error"]
    return Section("Laws", text, [Table("laws", headings, rows)])


def _measured(records: Sequence[Record], laws: dict[str, Law]) -> Section:
    loads = [load_of(record) for record in records]
    headings = ["frames", "image", "splats", *(f"{s} [s]" for s in LAWS if s != "memory")]
    headings += ["memory [MB]"]
    rows = []
    for record, load in zip(records, loads, strict=True):
        values = [value_of(record, stage) for stage in LAWS]
        texts = [f"{v:.1f}" if v is not None else "" for v in values]
        row = [str(load.frames), f"{load.width}x{load.height}", f"{load.splats:,}"]
        rows.append([*row, *texts])
    curves = []
    for stage, law in laws.items():
        known = [
            (law.at(load), value)
            for record, load in zip(records, loads, strict=True)
            if stage != "memory" and (value := value_of(record, stage))
        ]
        if known:
            curves.append(Curve(stage, [x for x, _ in known], [y for _, y in known], line=False))
    ends = [v for curve in curves for v in (*curve.x, *curve.y) if v > 0]
    if ends:
        curves.append(Curve("law = measurement", [min(ends), max(ends)], [min(ends), max(ends)]))
    chart = Chart(
        *("laws", "Seconds by the law and measured, one point per case and stage", curves),
        *("law [s]", "measured [s]"),
        log_x=True,
        log_y=True,
    )
    text = (
        "Frames, image width and splats vary one at a time; every row has its own walk. Points above the "
        "line took longer than the law predicts."
    )
    return Section("Measurements", text, [Table("measurements", headings, rows)], [chart])


def _threads(records: Sequence[Record]) -> Section:
    by_curve = {record["labels"]["curve"]: record for record in reversed(records)}
    rows = []
    if {"base", ONE_THREAD} <= set(by_curve):
        base, single = by_curve["base"], by_curve[ONE_THREAD]
        for stage in LAWS:
            one, many = value_of(single, stage), value_of(base, stage)
            if one and many and stage != "memory":
                rows.append([stage, f"{one:.1f}", f"{many:.1f}", f"{one / many:.2f}"])
        headings = ["stage", "1 thread [s]", f"{base['threads']} threads [s]", "times faster"]
    else:
        headings = ["stage", "1 thread [s]", "all threads [s]", "times faster"]
    text = "The same sizes on one thread and on all threads, each with its own walk."
    return Section("Threads", text, [Table("threads", headings, rows)])


def _plans(laws: dict[str, Law]) -> Section:
    stages = [stage for stage in laws if stage != "memory"]
    rows = []
    for plan in PLANS:
        seconds = {stage: laws[stage].at(plan) for stage in stages}
        total = sum(seconds.values())
        shared = sum(seconds.get(stage, 0.0) for stage in PER_FRAME)
        rows.append(
            [
                *(plan.name, str(plan.frames), f"{plan.width}x{plan.height}"),
                *(f"{plan.splats:,}", f"{plan.steps:,}"),
                *(f"{seconds[stage]:,.0f}" for stage in stages),
                *(f"{total:,.0f}", f"{100 * shared / total:.0f} %" if total else ""),
                f"{laws['memory'].at(plan) / 1e3:.1f}",
            ]
        )
    headings = ["plan", "frames", "image", "splats", "steps", *(f"{stage} [s]" for stage in stages)]
    headings += ["total [s]", "per frame", "memory [GB]"]
    text = (
        "Predictions of the laws for larger work on this machine. One scene runs in one process on one "
        "machine, so a second machine only helps with a second scene. The frames of one scene could be "
        "distributed for the share in the column 'per frame', rendering and back-projection, but matching "
        "and training could not. The plans exceed the measured sizes by up to a few hundred times: read them "
        "as orders of magnitude. Photographs beyond the setting image_memory are read again instead of kept."
    )
    return Section("Plans", text, [Table("plans", headings, rows)])
