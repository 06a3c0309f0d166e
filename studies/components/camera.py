"""What the training gains by knowing the camera: exposure, poses, shutter, blur, rims, depth and gloss.

Every object is recorded by a perfect camera, by the default one and with strong auto exposure; poses are
those of the recording, spoiled ones or estimated ones. Each recording is trained by the defaults and with all
of these parts off, and, where a part matters, by the defaults without it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import (
    Record,
    Value,
    final_psnr,
    group_by,
    number,
    one_gain_psnr,
    scaled_psnr,
)
from digs_warp.study.page import Section
from digs_warp.study.scenes import Objects
from digs_warp.study.studies.held_surface import ACCURACY
from digs_warp.study.table import Table

# Two records of the same recording: without and with something.
Pair = tuple[Record, Record]

# Losses below these are not named: another order of the views changes as much.
NAMED_DB, NAMED_SHARE = 0.1, 1.05


_in_place = number("surface", "accuracy_in_place", factor=1e3)


def placed_accuracy(record: Record) -> float | None:
    """Return the distance of the surface in its place to the true one [mm]; of earlier records as it lies."""
    found = _in_place(record)
    return ACCURACY(record) if found is None else found


def differences(pairs: Sequence[Pair], value: Value) -> list[float]:
    """Return the second of each pair minus the first, where both were measured."""
    known = [(value(one), value(other)) for one, other in pairs]
    return [b - a for a, b in known if a is not None and b is not None]


def made_worse(pairs: Mapping[tuple[str, str], Sequence[Pair]]) -> str:
    """Name what the defaults make worse."""
    images, surfaces = [], []
    for (source, name), found in pairs.items():
        gains = differences(found, final_psnr)
        if gains and median(gains) < -NAMED_DB:
            images.append(f"{name}, {source} ({median(gains):+.2f} dB)")
        known = [(placed_accuracy(one), placed_accuracy(other)) for one, other in found]
        shares = [b / a for a, b in known if a and b]
        if shares and median(shares) > NAMED_SHARE:
            surfaces.append(f"{name}, {source} ({median(shares):.2f} times as far)")
    sentences = [
        f"{what} the defaults make worse: {'; '.join(names) or 'none'}."
        for what, names in (("Images that", images), ("Surfaces that", surfaces))
    ]
    return " ".join(sentences)


# Small, because there are many cases. With 640x360 and 1,000 steps a case takes five times as long.
RECORDING: dict[str, Any] = {"frames": 32, "width": 480, "height": 270}

EXACT, SENSOR = "exact camera", "default sensor"
STEADY, EXPOSURE = "constant exposure", "auto exposure x4"
SPOILED, ESTIMATED, BLUR = "perturbed poses", "estimated poses", "exposure times x8"


@dataclass(frozen=True)
class Source:
    """Where the frames and poses of a case come from, as settings of recording and reconstruction.

    Structure from motion takes several times as long as the rest: ``effort`` is for the time budget.
    """

    recording: Mapping[str, Any]
    reconstruction: Mapping[str, Any]
    effort: float = 1.0
    perturbed: bool = False


# In less light than the exposure is set for: in all of it, an automatic one stays at its limit, darker by the
# same in nearly every frame.
DIM: dict[str, Any] = {"effects": "auto-exposure", "look.light_level": -0.6}

SOURCES = {
    EXACT: Source({"tier": "law"}, {}),
    SENSOR: Source({}, {}),
    # Not 0: then the depth would be exact, and that of the other is matched.
    STEADY: Source({**DIM, "strength": 0.001}, {}),
    EXPOSURE: Source({**DIM, "strength": 4.0}, {}),
    # "on", for the poses of a simulation are not refined by themselves.
    SPOILED: Source({}, {"sfm.refine_poses": "on"}, 2.0, perturbed=True),
    ESTIMATED: Source({}, {"sfm.poses": "sfm"}, 2.0),
    BLUR: Source({"effects": "image-blur", "strength": 8.0}, {}),
}
# Trained with nothing and with everything; the others serve a part alone.
COMPARED = (EXACT, SENSOR, STEADY, EXPOSURE, SPOILED, ESTIMATED)


@dataclass(frozen=True)
class Part:
    """A part of the training, the settings that switch it off, and the sources on which it matters."""

    off: Mapping[str, Any]
    matters: Sequence[str]


GLOSS = "color by view"
PARTS = {
    "depth term": Part({"train.depth_weight": 0.0}, (EXACT, SENSOR)),
    "exposure": Part({"train.fit_exposure": "off"}, (STEADY, EXPOSURE)),
    "refined poses": Part({"sfm.refine_poses": "off"}, (SPOILED, ESTIMATED)),
    "rolling shutter": Part({"train.rolling_shutter": "off"}, (SENSOR,)),
    "motion blur": Part({"train.motion_blur": "off"}, (BLUR,)),
    "clean rim": Part({"train.clean_rim": "off"}, (EXACT, SENSOR)),
    GLOSS: Part({"train.sh_degree": 1}, (EXACT,)),
}
# Shiny: on most of the others the photographs call for degree 1 anyway.
SHINY = ("sci_fi_case", "flight_helmet")

NOTHING, EVERYTHING = "nothing", "defaults"


def without(part: str) -> str:
    """Return the label of the defaults without a part."""
    return f"without {part}"


def cases(objects: Objects, seeds: int = 1, iterations: int = 300) -> list[Case]:
    """Return the cases: nothing beside everything, object by object; then each part left out."""
    shiny = [name for name in objects if name in SHINY] or list(objects)[:1]
    wanted = [
        (name, source, training)
        for name in objects
        for source in COMPARED
        for training in (NOTHING, EVERYTHING)
    ]
    wanted += [
        (name, source, training)
        for part, row in PARTS.items()
        for name in (shiny if part == GLOSS else objects)
        for source in row.matters
        for training in (EVERYTHING, without(part))
    ]
    return [
        _case(name, objects[name], source, training, seed, iterations)
        for seed in range(seeds)
        for name, source, training in dict.fromkeys(wanted)
    ]


def _case(
    name: str, scene: Mapping[str, Any], source: str, training: str, seed: int, iterations: int
) -> Case:
    given = SOURCES[source]
    return Case(
        labels={"object": name, "source": source, "training": training, "seed": seed},
        recording={**scene, **RECORDING, **given.recording, "seed": seed},
        reconstruction={
            **given.reconstruction,
            **_off(training),
            **{"train.stop.iterations": iterations, "train.seed": seed},
        },
        effort=given.effort,
        perturbed=given.perturbed,
    )


def _off(training: str) -> dict[str, Any]:
    """Return the settings that switch off what a training goes without."""
    left_out = [row.off for part, row in PARTS.items() if training in (NOTHING, without(part))]
    return {name: value for settings in left_out for name, value in settings.items()}


@dataclass(frozen=True)
class Figure:
    """What is measured: its heading, that of its differences, decimals, and where a record has it."""

    heading: str
    added: str
    decimals: int
    value: Value


FIGURES = (
    Figure("PSNR [dB]", "PSNR gained [dB]", 2, final_psnr),
    Figure("surface to truth [mm]", "distance added [mm]", 2, placed_accuracy),
    Figure("CPU [s]", "CPU added [s]", 1, number("cpu_seconds")),
)


def sections(records: Sequence[Record]) -> list[Section]:
    """Return nothing beside everything, and what each part is worth."""
    return [_compared(records), _left_out(records)]


def _pairs(records: Sequence[Record], one: str, other: str) -> dict[tuple[str, str], list[Pair]]:
    """Return the records of two trainings with the same (source, object), a pair for each seed."""
    found: dict[tuple[str, str], list[Pair]] = {}
    for (source, name, _), group in group_by(records, "source", "object", "seed").items():
        by_training = {record["labels"]["training"]: record for record in group}
        if one in by_training and other in by_training:
            pair = by_training[one], by_training[other]
            found.setdefault((source, name), []).append(pair)
    return found


def _compared(records: Sequence[Record]) -> Section:
    pairs = _pairs(records, NOTHING, EVERYTHING)
    headings = [f"{f.heading}: {name}" for f in FIGURES for name in (NOTHING, EVERYTHING)]
    by_source = {
        source: [pair for key, found in pairs.items() if key[0] == source for pair in found]
        for source in COMPARED
    }
    medians = [
        [source, str(len(found)), *_cells(found)] for source, found in by_source.items() if found
    ]
    names = dict.fromkeys(name for _, name in pairs)
    every = [
        [name, source, *_cells(pairs[source, name])]
        for name in names
        for source in COMPARED
        if (source, name) in pairs
    ]
    text = (
        "Nothing: exposure, pose refinement, rolling shutter, motion blur, depth term and clean rim are off, "
        "and the color is of degree 1. Defaults: every part decides by itself. PSNR is that of the object in "
        "eight views of a perfect camera on another walk, after one brightness and white balance were fitted "
        "to all of them, which auto exposure leaves open; the distance is that of the rendered surface to "
        "the true mesh. Both are taken after one rigid motion of the whole result, which found poses leave "
        "open; the last table has PSNR without it, too, and after a similarity: the scale of found poses is "
        "that of the given centers or of the depth. CPU seconds are those of all threads for the "
        "reconstruction, without the recording and structure from motion. With "
        f"{EXPOSURE}, the camera follows the light four times as far as it should, and nothing else is wrong "
        f"with its images; {STEADY} is the same light without that. With the usual size of photographs, "
        f"instead of {_size()}, blur and shutter move the image farther. The first table has the medians "
        "over the objects. "
        f"{made_worse(pairs)}"
    )
    tables = [
        Table("camera_medians", ["source", "recordings", *headings], medians),
        Table("camera_objects", ["object", "source", *headings], every),
        *_places(by_source),
    ]
    return Section("Nothing and everything", text, tables, [_chart(pairs)] if pairs else [])


def _places(by_source: Mapping[str, Sequence[Pair]]) -> list[Table]:
    """Return the medians of PSNR as the results lie, in their places and in their scale, for found poses."""
    values = {
        "as it lies": one_gain_psnr,
        "in its place": final_psnr,
        "in its place and scale": scaled_psnr,
    }
    figures = [Figure("", "", 2, value) for value in values.values()]
    rows = [
        [source, *(_median([pair[i] for pair in pairs], f) for i in (0, 1) for f in figures)]
        for source in (SPOILED, ESTIMATED)
        if (pairs := by_source[source])
    ]
    headings = [f"PSNR [dB], {name}: {where}" for name in (NOTHING, EVERYTHING) for where in values]
    return [Table("camera_places", ["source", *headings], rows)] if rows else []


def _size() -> str:
    return "{frames} frames of {width}x{height}".format(**RECORDING)


def _chart(pairs: Mapping[tuple[str, str], Sequence[Pair]]) -> Chart:
    """Return the gain of everything over nothing, a point for each object and seed."""
    points: dict[str, list[tuple[float, int]]] = {}
    for (source, name), found in pairs.items():
        row = COMPARED.index(source)
        points.setdefault(name, []).extend((x, row) for x in differences(found, final_psnr))
    curves = [
        Curve(name, [x for x, _ in found], [row for _, row in found], line=False)
        for name, found in points.items()
    ]
    return Chart(
        *("gains", "Gain of all parts together, object by object", curves),
        *("PSNR on the object with the defaults, minus that with nothing [dB]", ""),
        rows=COMPARED,
    )


def _cells(pairs: Sequence[Pair]) -> list[str]:
    """Return the medians of every figure without and with; empty where it was not measured."""
    return [_median([pair[i] for pair in pairs], figure) for figure in FIGURES for i in (0, 1)]


def _median(records: Sequence[Record], figure: Figure) -> str:
    values = [v for record in records if (v := figure.value(record)) is not None]
    return f"{median(values):.{figure.decimals}f}" if values else ""


def _left_out(records: Sequence[Record]) -> Section:
    """Return what the defaults gain by each part."""
    rows, every = [], []
    for part, row in PARTS.items():
        pairs = _pairs(records, without(part), EVERYTHING)
        for source in row.matters:
            own = {name: found for (where, name), found in pairs.items() if where == source}
            together = [pair for found in own.values() for pair in found]
            gains = differences(together, final_psnr)
            if not gains:
                continue
            spread = [f"{v:+.2f}" for v in (median(gains), min(gains), max(gains))]
            rows.append([part, source, str(len(gains)), *spread, *_changes(together)[1:]])
            every += [[part, source, name, *_changes(found)] for name, found in own.items()]
    text = (
        "The defaults, minus the defaults without one part, on the recordings where the part matters. A part "
        "helps where PSNR is gained and the distance to the true surface falls. The first table has the "
        "medians over the objects, and the smallest and the largest gain. Color by view is measured on shiny "
        f"objects; with {BLUR}, the photographs have no fault but blur."
    )
    added = [figure.added for figure in FIGURES]
    headings = ["part", "source", "recordings", added[0], "smallest", "largest", *added[1:]]
    tables = [
        Table("camera_parts", headings, rows),
        Table("camera_parts_objects", ["part", "source", "object", *added], every),
    ]
    return Section("What each part is worth", text, tables)


def _changes(pairs: Sequence[Pair]) -> list[str]:
    """Return the median difference of every figure; empty where it was not measured."""
    found = [(differences(pairs, figure.value), figure.decimals) for figure in FIGURES]
    return [f"{median(values):+.{decimals}f}" if values else "" for values, decimals in found]
