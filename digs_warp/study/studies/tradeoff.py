"""What accuracy costs in time: each knob of the chain alone, and the front of what is worth its seconds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from digs_warp.study.engine.case import Case
from digs_warp.study.engine.charts import Chart, Curve
from digs_warp.study.engine.page import Section, Table
from digs_warp.study.engine.records import Record, Spread, group_by, pareto_front, spread
from digs_warp.study.studies.scenes import objects

# The point that every knob starts from.
RECORDING: dict[str, Any] = {"frames": 40, "width": 640, "height": 360, "samples_per_pixel": 4}
RECONSTRUCTION: dict[str, Any] = {"train.iterations": 500}
USUAL = "usual"

# Knob -> (part of the chain, setting, values); a size changes both sides of the image.
KNOBS: dict[str, tuple[str, str, Sequence[Any]]] = {
    "iterations": ("reconstruction", "train.iterations", (100, 250, 1000, 2000)),
    "sensor tier": ("recording", "tier", ("truth", "law", "matcher")),
    "frames": ("recording", "frames", (16, 24, 60, 90)),
    "image width": ("recording", "width", (320, 480, 960)),
    "samples per pixel": ("recording", "samples_per_pixel", (1, 16)),
    "voxel size [mm]": ("reconstruction", "init.voxel_size", (16, 8, 2)),
    "initialization": ("reconstruction", "init.strategy", ("depth", "fusion", "default", "random")),
    "density control": ("reconstruction", "train.density", ("default", "absgrad", "mcmc")),
    "SH degree": ("reconstruction", "train.sh_degree", (0, 2, 3)),
    "poses": ("reconstruction", "sfm.poses", ("sfm",)),
}


def cases(objects_count: int = 2, seeds: int = 1, iterations: int = 500) -> list[Case]:
    """Return the usual settings, then one knob turned at a time; objects innermost."""
    usual = RECONSTRUCTION | {"train.iterations": iterations}
    turned = [(knob, value) for knob, (_, _, values) in KNOBS.items() for value in values]
    return [
        _case(name, recording, knob, value, seed, usual)
        for seed in range(seeds)
        for knob, value in [(USUAL, ""), *turned]
        for name, recording in objects(objects_count).items()
    ]


def _case(
    name: str, scene: dict[str, Any], knob: str, value: Any, seed: int, usual: dict[str, Any]
) -> Case:
    recording = scene | RECORDING | {"seed": seed}
    reconstruction = usual | {"train.seed": seed}
    if knob != USUAL:
        part, setting, _ = KNOBS[knob]
        changes = {setting: value}
        if knob == "image width":
            changes["height"] = value * 9 // 16
        if knob == "voxel size [mm]":
            changes[setting] = value / 1e3
        if part == "recording":
            recording |= changes
        else:
            reconstruction |= changes
    labels = {"object": name, "knob": knob, "value": value, "seed": seed}
    return Case(labels, recording, reconstruction)


def sections(records: Sequence[Record]) -> list[Section]:
    """Return the front over all cases, and a table per knob."""
    measured = _measured(group_by(records, "knob", "value"))
    usual = measured.get((USUAL, ""))
    if usual is None:
        return [Section("Nothing to compare", "The case with the usual settings is missing.")]
    return [_front(measured), *_knob_sections(measured, usual)]


def total_seconds(record: Record) -> float:
    """Return the seconds of the whole chain [s], without compiling kernels."""
    stages = record["seconds"].items()
    reconstruction = sum(
        s for name, s in stages if name not in ("compile kernels", "measure course")
    )
    # Threads that sense beside the rendering overlap with it: rendering is what one waits for.
    waited = ("load", "prepare", "plan", "render")
    return reconstruction + sum(record["recording_seconds"].get(name, 0.0) for name in waited)


def yardstick_psnr(record: Record) -> float | None:
    """Return the PSNR [dB] on views of a perfect camera, the same for all recordings of an object."""
    return record["yardstick"].get("psnr")


@dataclass(frozen=True)
class Best:
    """The best setting within a time.

    Attributes:
        name: what was turned, in words.
        settings: of recording and reconstruction, without the scene and the seeds.
        seconds: time of the whole chain.
        quality: PSNR [dB] on views of a perfect camera.
    """

    name: str
    settings: dict[str, Any]
    seconds: Spread
    quality: Spread


def best_within(records: Sequence[Record], budget: float) -> Best | None:
    """Return the setting of the highest quality whose mean time is within ``budget`` seconds."""
    groups = group_by(records, "knob", "value")
    within = {
        key: (seconds, quality)
        for key, (seconds, quality) in _measured(groups).items()
        if seconds.mean <= budget
    }
    if not within:
        return None
    key = max(within, key=lambda k: within[k][1].mean)
    record = groups[key][0]
    settings = {**record["recording"], **record["reconstruction"]}
    kept = {
        n: v for n, v in settings.items() if n not in ("mesh", "environment", "seed", "train.seed")
    }
    return Best(_name(key), kept, *within[key])


Measured = dict[tuple[Any, ...], tuple[Spread, Spread]]


def _measured(groups: Mapping[tuple[Any, ...], list[Record]]) -> Measured:
    """Return mean time and quality of every setting."""
    return {
        key: (seconds, quality)
        for key, found in groups.items()
        if (seconds := spread(found, total_seconds)) and (quality := spread(found, yardstick_psnr))
    }


def _front(measured: Measured) -> Section:
    keys = list(measured)
    points = [(seconds.mean, quality.mean) for seconds, quality in measured.values()]
    front = pareto_front(points)
    rows = [
        [_name(keys[i]), measured[keys[i]][0].text(1), measured[keys[i]][1].text(2)] for i in front
    ]
    curves = [
        Curve("all settings", [x for x, _ in points], [y for _, y in points], line=False),
        Curve(
            "nothing is both faster and better",
            [points[i][0] for i in front],
            [points[i][1] for i in front],
            notes=[_name(keys[i]) for i in front],
        ),
    ]
    chart = Chart(
        *("front", "Quality against time of the whole chain", curves),
        *("seconds", "PSNR on views of a perfect camera [dB]"),
        log_x=True,
    )
    text = (
        "Every point is one setting, averaged over the objects; from the recording to the Gaussians. All are "
        "measured on the same views of a perfect camera on a walk that no recording took."
    )
    table = Table("front", ["setting", "seconds", "PSNR [dB]"], rows)
    return Section("What is worth its time", text, [table], [chart])


def _knob_sections(measured: Measured, usual: tuple[Spread, Spread]) -> list[Section]:
    found = []
    for knob in KNOBS:
        turned = {key: value for key, value in measured.items() if key[0] == knob}
        if not turned:
            continue
        rows = [
            [str(key[1]), seconds.text(1), quality.text(2), *_price(seconds, quality, usual)]
            for key, (seconds, quality) in turned.items()
        ]
        rows.append([f"{USUAL} ({_usual_value(knob)})", usual[0].text(1), usual[1].text(2), "", ""])
        headings = [knob, "seconds", "PSNR [dB]", "seconds more", "dB more"]
        name = f"knob_{knob.split(' [')[0].replace(' ', '_')}"
        found.append(
            Section(knob.capitalize(), _sentence(turned, usual), [Table(name, headings, rows)])
        )
    return found


def _sentence(turned: Measured, usual: tuple[Spread, Spread]) -> str:
    """Say what the best and the fastest value of a knob buy, against the usual one."""
    best = max(turned, key=lambda key: turned[key][1].mean)
    fastest = min(turned, key=lambda key: turned[key][0].mean)
    words = []
    for title, key in (("Best", best), ("Fastest", fastest)):
        seconds, quality = _difference(*turned[key], usual)
        words.append(f"{title}: {key[1]}, {quality:+.2f} dB for {seconds:+.1f} s")
    return "; ".join(words) + ", against the usual settings."


def _price(seconds: Spread, quality: Spread, usual: tuple[Spread, Spread]) -> tuple[str, str]:
    more_seconds, more_quality = _difference(seconds, quality, usual)
    return f"{more_seconds:+.1f}", f"{more_quality:+.2f}"


def _difference(
    seconds: Spread, quality: Spread, usual: tuple[Spread, Spread]
) -> tuple[float, float]:
    return seconds.mean - usual[0].mean, quality.mean - usual[1].mean


def _usual_value(knob: str) -> Any:
    """Return what the usual settings have for a knob."""
    from digs_warp.reconstruct import ReconstructConfig
    from sim.config import SimulateConfig

    part, setting, _ = KNOBS[knob]
    changed = RECORDING if part == "recording" else RECONSTRUCTION
    if setting in changed:
        return changed[setting]
    if setting == "init.voxel_size":
        return 1e3 * ReconstructConfig().init.voxel_edge
    value: Any = SimulateConfig() if part == "recording" else ReconstructConfig()
    for name in setting.split("."):
        value = getattr(value, name)
    return value


def _name(key: tuple[Any, ...]) -> str:
    return USUAL if key[0] == USUAL else f"{key[0].split(' [')[0]} {key[1]}"
