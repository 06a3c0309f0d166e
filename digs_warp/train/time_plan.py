"""How many steps fit into a time budget; `digs_warp.train.trainer` says how schedules follow the time."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TimePlan:
    """What was chosen for a time budget.

    Attributes:
        iterations: steps that fit, at least one.
        budget: time for the steps [s].
        step_seconds: time of a step, as measured [s].
    """

    iterations: int
    budget: float
    step_seconds: float

    def __str__(self) -> str:
        return f"{self.iterations:,} iterations: a step takes {1e3 * self.step_seconds:.0f} ms"


def plan_time(budget: float, most: int, step_seconds: float) -> TimePlan:
    """Choose the steps of a run of at most ``most``; a step takes so many seconds."""
    return TimePlan(max(1, int(min(budget / step_seconds, most))), budget, step_seconds)
