"""What planning the depth camera's effects costs, and after how many frames it has paid for itself."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from statistics import median

import numpy as np

from digs_warp.sim.record.sensor_plan import (
    SensorPlan,
    look_around,
    plan_for_facts,
    with_adaptation,
)
from digs_warp.sim.record.session import Session
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.results import Result
from digs_warp.study.timing import Stopwatch

ROUNDS = 9


def planning_result(scene: str, session: Session, fresh: Callable[[], FrameTruth]) -> Result:
    """Return the processor time of planning, metering and a frame, with the plan and with all effects.

    Metering the light along the walk is work of the effects that follow it, which "all effects" have, too.
    The two kinds of frame take turns, so that other programs disturb both; what the plan saves is the median
    of the differences. Bands and views of the shutter are on in both.

    Args:
        scene: its name.
        session: of the recording.
        fresh: returns a frame of it with nothing computed yet.
    """
    everything = replace(session, config=replace(session.config, effects="all"))
    sessions = (session, everything)
    plans = [_planned(one) for one in sessions]
    planning = min(cpu_in_turns([partial(_planned, session)], ROUNDS)[0])
    meterings = cpu_in_turns([partial(with_adaptation, p, session) for p in plans], 3)
    plans = [with_adaptation(one, session) for one in plans]
    kinds = cpu_in_turns([partial(_sensed_frame, fresh, one) for one in plans], ROUNDS)
    metering, frame = (tuple(map(min, times)) for times in (meterings, kinds))
    saved = median(b - a for a, b in zip(*kinds, strict=True))
    megapixels = fresh().depth.size / 1e6
    return Result(
        {"scene": scene},
        {
            "planning [s]": planning,
            "metering [s]": metering[0],
            "frame as planned [ms/MP]": 1e3 * frame[0] / megapixels,
            "frame with all effects [ms/MP]": 1e3 * frame[1] / megapixels,
            "saved [ms/MP]": 1e3 * saved / megapixels,
            "frames that pay for planning": frames_that_pay(
                planning + metering[0] - metering[1], saved
            ),
        },
        "plans",
    )


def frames_that_pay(spent: float, saved: float) -> float:
    """Return after how many frames what was spent once is saved; both [s]. Infinite: never."""
    if spent <= 0:
        return 0.0
    return spent / saved if saved > 0 else np.inf


def cpu_in_turns(functions: Sequence[Callable[[], object]], rounds: int) -> list[list[float]]:
    """Return the processor time of each call [s], one list per function; the functions take turns.

    A first call of each also loads and compiles, and does not count.
    """
    times: list[list[float]] = [[] for _ in functions]
    for function in functions:
        function()
    for _ in range(rounds):
        for function, mine in zip(functions, times, strict=True):
            watch = Stopwatch()
            with watch:
                function()
            mine.append(watch.cpu_seconds)
    return times


def _planned(session: Session) -> SensorPlan:
    return plan_for_facts(look_around(session), session.rig, session.config)


def _sensed_frame(fresh: Callable[[], FrameTruth], chosen: SensorPlan) -> np.ndarray:
    """Return the disparity of the default sensor, from rendered images to the end."""
    truth = fresh()
    recorded = recorded_images(truth, chosen.pixel_effects, adaptation=chosen.adapted(0.0))
    return sense(truth, "guided", chosen.depth, recorded=recorded).disparity
