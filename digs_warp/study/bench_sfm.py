"""`digs-warp bench sfm|sfm-full|sfm-sensor`: seconds, memory and pose errors of structure from motion.

On photographs of the built-in object in its room. `sfm` and `sfm-full` change one setting at a time, on
photographs of an ideal camera: the errors are those of structure from motion alone. `sfm-sensor` repeats the
walk with the sensor that the scene calls for, with one kind of imperfection removed, and with one alone; with
and without the correction of the rolling shutter. The true pose of a frame is that of its middle row.
Every case starts from an empty workspace.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.device.parallel import default_threads
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.estimate import structure_from_motion
from digs_warp.poses.from_images.similarity import pose_errors
from digs_warp.record.progress import progress
from digs_warp.sim.record.sensor_plan import SensorPlan
from digs_warp.sim.sensor.color import IMAGE_BLUR, PIXEL_EFFECTS, ROLLING_SHUTTER
from digs_warp.study.results import Result
from digs_warp.study.sfm_photographs import (
    IDEAL,
    Photographs,
    only,
    photograph_walk,
    planned_sensor,
)
from digs_warp.study.timing import Stopwatch, peak_memory

SMALL = Photographs(48, 800, 450)
FULL = Photographs(200, 1600, 900)  # the recording of the paper, at its training size

# Photographs of the paper's size take minutes to render: they stay for the next time.
KEPT = Path(tempfile.gettempdir()) / "digs-warp-photographs"

# One choice changed at a time.
DEFAULT = SfmConfig(pairing="sequential")
CHOICES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("default", {}),
    ("exhaustive pairs", {"pairing": "exhaustive"}),
    ("half the overlap", {"overlap": 3}),
    ("twice the overlap", {"overlap": 12}),
    ("no loops", {"loop_images": 0}),
    ("1000 features", {"features": 1000}),
    ("4000 features", {"features": 4000}),
    ("features at 400 px", {"feature_size": 400}),
    ("not enlarged", {"double_size": False}),
)
# For the large recording; small photographs are not reduced.
FULL_CHOICES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("default", {}),
    ("features at 1600 px", {"feature_size": 1600}),
)

STAGES = ("features", "pairs", "match", "map")

WALK = Photographs(60, 960, 540)
# What is removed from the sensor, or left alone.
PARTS = (
    ("rolling shutter", frozenset({ROLLING_SHUTTER.name})),
    ("blur", frozenset({IMAGE_BLUR.name})),
    ("noise and exposure", frozenset(effect.name for effect in PIXEL_EFFECTS)),
)
# Units of what a case costs, which does not depend on the sensor.
COSTS = ("[s]", "[MB]")


def bench_sfm() -> list[Result]:
    """Return the results of all choices on a small recording."""
    with tempfile.TemporaryDirectory() as folder:
        frames = photograph_walk(SMALL.session(), Path(folder))
        return measure(frames, _cases(CHOICES), {"images": str(SMALL)})


def bench_sfm_full() -> list[Result]:
    """Return the results for a recording of the paper's size, with full-size and with reduced features."""
    frames = photograph_walk(FULL.session(), KEPT / str(FULL).replace(" ", "-"))
    return measure(frames, _cases(FULL_CHOICES), {"images": str(FULL)})


def _cases(choices: Sequence[tuple[str, dict[str, Any]]]) -> list[tuple[str, SfmConfig]]:
    return [(name, replace(DEFAULT, **change)) for name, change in choices]


def bench_sfm_sensor(photographs: Photographs = WALK) -> list[Result]:
    """Return the quality with the default settings for every sensor."""
    session = photographs.session()
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, sensor) in enumerate(sensors(planned_sensor(session))):
            frames = photograph_walk(session, Path(folder) / str(number), sensor)
            readout_time = sensor.shutter(session.rig).readout_time
            cases = [(name, replace(DEFAULT, readout_time=readout_time))]
            if readout_time > 0:
                cases.append((f"{name}, not corrected", DEFAULT))
            for result in measure(frames, cases, {"images": str(photographs)}):
                quality = {n: v for n, v in result.values.items() if not n.endswith(COSTS)}
                results.append(replace(result, values=quality))
    return results


def sensors(planned: SensorPlan) -> list[tuple[str, SensorPlan]]:
    """Return the sensors to compare by name; parts that the plan does not have are left out."""
    on = frozenset(planned.effects_on)
    parts = [(name, effects & on) for name, effects in PARTS if effects & on]
    without = [(f"without {name}", only(planned, on - effects)) for name, effects in parts]
    alone = [(f"{name} alone", only(planned, effects)) for name, effects in parts]
    return [("ideal camera", IDEAL), ("planned sensor", planned), *without, *alone]


def measure(
    frames: Sequence[Frame], cases: Sequence[tuple[str, SfmConfig]], labels: dict[str, Any]
) -> list[Result]:
    """Run every case on the photographs; ``labels`` are added to those of every result."""
    results = []
    with tempfile.TemporaryDirectory() as folder, progress(len(cases), "Measuring", "case") as bar:
        for number, (name, config) in enumerate(cases):
            values = run_case(frames, config, Path(folder) / f"workspace{number}")
            shared = labels | {"threads": default_threads()}
            results.append(Result({"choice": name} | shared, values))
            bar.update()
    return results


def run_case(frames: Sequence[Frame], config: SfmConfig, workspace: Path) -> dict[str, float]:
    """Return the numbers of one case; of a failed one only its time."""
    watch = Stopwatch()
    try:
        with peak_memory() as memory, watch:
            result = structure_from_motion(frames, config, workspace)
    except DigsError:
        return {"total [s]": watch.seconds, "registered [images]": 0}
    errors = pose_errors(result.model, frames)
    quality = asdict(result.quality)
    stages = {f"{stage} [s]": result.seconds[stage] for stage in STAGES}
    return stages | {
        "total [s]": watch.seconds,
        "all cores [s]": watch.cpu_seconds,
        "peak [MB]": memory.peak / 2**20,
        "registered [images]": quality["registered"],
        "points": quality["points"],
        "reprojection [px]": quality["reprojection_error_px"],
        "center median [mm]": 1e3 * float(np.median(errors.centers_m)),
        "center worst [mm]": 1e3 * float(errors.centers_m.max()),
        "rotation median [deg]": float(np.median(errors.rotations_deg)),
    }
