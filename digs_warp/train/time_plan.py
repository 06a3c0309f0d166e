"""How many steps fit into a time budget, and the progress along which all schedules run.

A few steps of a copy tell how long a step takes, and the schedules are planned to end with the time. Later
steps take longer or shorter, as the Gaussians change and other programs come and go: now and then the rest of
the progress is spread over as many steps as still fit.
"""

from dataclasses import dataclass

# With a dense start, quality peaks at 500 steps: 250 are 0.20 dB worse, 1000 are 0.51 dB, 2000 are 0.69 dB
# (docs/study/tradeoff/report.md, "Iterations"). A longer budget is not used up.
MOST_DENSE_STEPS = 500

# The rest is spread again whenever this share of the time that was left has passed: the more often, the
# nearer the end is.
RESPREAD_SHARE = 0.1


@dataclass(frozen=True)
class TimePlan:
    """What was chosen for a time budget.

    Attributes:
        iterations: steps of the run.
        most: more do not pay.
        budget: time for the steps [s].
        step_seconds: time of a step, as measured [s].
        because: why, in words.
    """

    iterations: int
    most: int
    budget: float
    step_seconds: float
    because: str

    def __str__(self) -> str:
        return f"{self.iterations:,} iterations: {self.because}"


def plan_time(budget: float, most: int, step_seconds: float) -> TimePlan:
    """Choose the steps of a run, at least one.

    Args:
        budget: time for the steps [s].
        most: more steps do not pay.
        step_seconds: time of a step [s], above 0.
    """
    steps = max(1, int(min(budget / step_seconds, most)))
    words = f"a step takes {1e3 * step_seconds:.0f} ms"
    words += "; more are not worth their time" if steps == most else ""
    return TimePlan(steps, most, budget, step_seconds, words)


class Progress:
    """How far a run is, 0 to 1, by its steps: along a straight line, until `respread` bends it.

    Attributes:
        steps: of the whole run, as planned now.
        most: no more than these.
    """

    def __init__(self, steps: int, most: int | None = None) -> None:
        self.steps = steps
        self.most = steps if most is None else most
        self._from = (0, 0.0)  # the step and the progress that the line starts at

    def at(self, step: int) -> float:
        """Return the progress before a step."""
        first, reached = self._from
        share = (step - first) / max(1, self.steps - first)
        return min(1.0, reached + (1.0 - reached) * share)

    def respread(self, step: int, steps_left: float) -> None:
        """Spread the rest of the progress, if there is any, over as many steps from ``step`` on."""
        if self.at(step) >= 1.0:
            return
        self._from = (step, self.at(step))
        self.steps = step + max(1, int(min(steps_left, self.most - step)))

    def state(self) -> tuple[float, ...]:
        """Return what a checkpoint has to hold."""
        return (float(self.steps), float(self.most), float(self._from[0]), self._from[1])

    def restore(self, state: tuple[float, ...]) -> None:
        """Continue from a `state`."""
        steps, most, first, reached = state
        self.steps, self.most, self._from = int(steps), int(most), (int(first), reached)


@dataclass
class Clock:
    """Spreads the rest of a run over the time that is left.

    Attributes:
        budget: time for all steps [s].
        last: steps and seconds when it did so the last time, or when the run went on.
    """

    budget: float
    last: tuple[int, float] = (0, 0.0)

    def is_over(self, step: int, seconds: float) -> bool:
        """Whether the time is used up after a step; the first is taken in any case."""
        return step > 0 and seconds >= self.budget

    def after_step(self, progress: Progress, step: int, seconds: float) -> None:
        """Respread the progress if it is time, by how long the latest steps took.

        Args:
            progress: of the run.
            step: steps taken.
            seconds: of training so far.
        """
        last_step, last_seconds = self.last
        if seconds - last_seconds < RESPREAD_SHARE * (self.budget - last_seconds):
            return
        step_seconds = (seconds - last_seconds) / (step - last_step)
        progress.respread(step, (self.budget - seconds) / step_seconds)
        self.last = (step, seconds)
