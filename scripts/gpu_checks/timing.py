"""How long the stages of a step take."""

import time
from collections.abc import Callable

import numpy as np
import warp as wp

from gpu_checks.learning import Training, make_training
from gpu_checks.parts import Findings, Run

REPEATS = 20
MOST_SECONDS = 2.0  # for one figure: a slow stage is repeated less often

# gsplat's documentation: docs/source/tests/profile.rst (version 1.0.0, not packed) and eval.rst.
PUBLISHED = {
    "gsplat 1.0, TITAN RTX, 112,000 splats of the garden without spherical harmonics, 1920x1080: forward "
    "(projection, lists, image) [ms]": 1000.0 / 348.3,
    "the same: backward [ms]": 1000.0 / 171.9,
    "gsplat, A100, Mip-NeRF 360, 30,000 steps with at most 1,000,000 splats in 15.4 min: step [ms]": 15.4
    * 60e3
    / 30e3,
    "gsplat, TITAN RTX, Mip-NeRF 360, 30,000 steps in 35 min 49 s: step [ms]": 2149e3 / 30e3,
}


def times(run: Run, findings: Findings) -> None:
    """Time the stages at every number of splats, beside what gsplat publishes."""
    for name, value in PUBLISHED.items():
        findings.note(name, value)
    for count in run.timed:
        findings.attempt(f"{count:,} splats", lambda n=count: _time_training(run, n, findings))


def _time_training(run: Run, count: int, findings: Findings) -> None:
    """Time one training; the kernels are those that the device gets anyway."""
    size = run.timed_width, run.timed_height
    label = f"{count:,} splats, {size[0]}x{size[1]}"
    job = make_training(run, run.device, None, count, size)
    job.step()
    wp.synchronize()
    binner = job.renderer.binner
    findings.note(f"{label}: pairs of a splat and a tile", binner.total_pairs)
    for name, stage in _stages(job).items():
        findings.note(f"{label}: {name} [ms]", 1e3 * median_seconds(stage))
    if run.has_gpu:
        used = wp.get_mempool_used_mem_high(run.device)
        findings.note(f"{label}: most memory [GB]", used / 1e9)


def _stages(job: Training) -> dict[str, Callable[[], object]]:
    """Return what is timed by name, in the order of a step."""
    renderer = job.renderer
    stages: dict[str, Callable[[], object]] = {"forward, all": lambda: job.draw(0)}
    stages |= {f"  {name}": stage for name, stage in renderer.stages().items()}
    stages |= {"backward, all": renderer.backward}
    stages |= {"  compose the target": lambda: job.compose(0), "  loss": job.compare}
    return stages | {"  Adam": lambda: job.optimizer.update(0.0), "step": job.step}


def median_seconds(work: Callable[[], object]) -> float:
    """Return the median time of a call, waiting for the device after each."""
    found: list[float] = []
    begin = time.perf_counter()
    for number in range(REPEATS + 2):
        wp.synchronize()
        start = time.perf_counter()
        work()
        wp.synchronize()
        if number >= 2 or time.perf_counter() - begin > MOST_SECONDS:
            found.append(time.perf_counter() - start)
        if time.perf_counter() - begin > MOST_SECONDS:
            break
    return float(np.median(found))
