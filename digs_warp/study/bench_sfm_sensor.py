"""`digs-warp bench sfm-sensor`: which imperfection of the camera costs structure from motion exactness.

The same walk photographed by an ideal camera, by the sensor that the scene calls for, and by that sensor
with one kind of imperfection taken away, or alone; where its shutter rolls, with and without the correction
for that. The true pose of a frame is that of its middle row.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

from digs_warp.sim.sensor.color import IMAGE_BLUR, PIXEL_EFFECTS, ROLLING_SHUTTER
from digs_warp.sim.sensor_plan import SensorPlan
from digs_warp.study.bench_sfm import DEFAULT, measure
from digs_warp.study.results import Result
from digs_warp.study.sfm_photographs import (
    IDEAL,
    Photographs,
    only,
    photograph_walk,
    planned_sensor,
)

WALK = Photographs(60, 960, 540)

# Units of what a case costs.
COSTS = ("s", "MB")

# What is taken away, or left alone.
PARTS = (
    ("rolling shutter", frozenset({ROLLING_SHUTTER.name})),
    ("blur", frozenset({IMAGE_BLUR.name})),
    ("noise and exposure", frozenset(effect.name for effect in PIXEL_EFFECTS)),
)


def bench_sfm_sensor(photographs: Photographs = WALK) -> list[Result]:
    """Return what comes out with the default settings for every sensor; the time does not depend on it."""
    session = photographs.session()
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, sensor) in enumerate(sensors(planned_sensor(session))):
            frames = photograph_walk(session, Path(folder) / str(number), sensor)
            readout_time = sensor.shutter(session.rig).readout_time
            cases = [(name, replace(DEFAULT, readout_time=readout_time))]
            if readout_time > 0:
                cases.append((f"{name}, not corrected", DEFAULT))
            measured = measure(frames, cases, {"images": str(photographs)})
            results += [result for result in measured if result.unit not in COSTS]
    return results


def sensors(planned: SensorPlan) -> list[tuple[str, SensorPlan]]:
    """Return the named sensors that are compared; parts that the plan does not have are left out."""
    on = frozenset(planned.effects_on)
    parts = [(name, effects & on) for name, effects in PARTS if effects & on]
    without = [(f"without {name}", only(planned, on - effects)) for name, effects in parts]
    alone = [(f"{name} alone", only(planned, effects)) for name, effects in parts]
    return [("ideal camera", IDEAL), ("planned sensor", planned), *without, *alone]
