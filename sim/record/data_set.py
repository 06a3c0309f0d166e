"""Many recordings at once: every mesh in every environment on several walks, or scenes drawn at random."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.about import RecordedObject
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.viewpoints import spread
from digs_warp.engines.config import EngineConfig
from digs_warp.engines.engine import Needs
from digs_warp.engines.run import run_tasks
from digs_warp.engines.start import needs_of, started
from digs_warp.engines.task import Results, Task
from digs_warp.record.files import digest, to_json, write_atomically
from digs_warp.record.layout import DATA_SET
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.draws import SceneJob
from digs_warp.sim.record.record import is_finished, simulate
from digs_warp.words import counted

BUILT_IN_OBJECT, BUILT_IN_ROOM = "built-in-object", "built-in-room"

# What is known of a recording in the end.
NUMBERS = ("frames", "seconds", "fill", "error_mm", "size")

# Frames of a recording whose depth is evaluated for the summary.
JUDGED_FRAMES = 3


@dataclass(frozen=True)
class SceneResult:
    """The outcome of a recording.

    Attributes:
        name: that of the job.
        error: why it failed; empty when it is done.
        frames: number of frames written.
        seconds: wall-clock time of the recording; 0 where it failed.
        fill: share of the object's pixels with depth, 0 to 1; None where nothing could be judged.
        error_mm: median absolute depth error on the object [mm]; None likewise.
        size: longest side of the object [m]; None where it failed.
        drawn: that of the job.
        failure: the class of the error, see `digs_warp.engines.engine.FailureClass`; empty when it is done.
    """

    name: str
    error: str
    frames: int
    seconds: float
    fill: float | None = None
    error_mm: float | None = None
    size: float | None = None
    drawn: Mapping[str, Any] | None = None
    failure: str = ""

    def __str__(self) -> str:
        """The outcome in a phrase, without the name."""
        if self.error:
            return f"failed: {self.error}"
        words = f"{counted(self.frames, 'frame')} in {self.seconds:.1f} s"
        if self.size is not None:
            words += f", object of {self.size:.3g} m"
        if self.fill is not None:
            words += f", depth on {self.fill:.1%} of the object"
        if self.error_mm is not None:
            words += f", median error {self.error_mm:.2f} mm"
        return words


def plan_jobs(
    config: SimulateConfig,
    meshes: Sequence[Path],
    environments: Sequence[Path],
    trajectories: int = 1,
) -> tuple[SceneJob, ...]:
    """Return a job for every mesh in every environment on every walk.

    Args:
        config: settings of all recordings; walk n has seed ``config.seed`` + n.
        meshes: none: that of ``config``.
        environments: none: that of ``config``.
        trajectories: walks per pair, >= 1.
    """
    several = "+".join(path.stem for path in config.scene)
    objects = _named([*meshes] or [config.mesh], several or BUILT_IN_OBJECT)
    rooms = _named([*environments] or [config.environment], BUILT_IN_ROOM)
    return tuple(
        SceneJob(
            f"{objects[mesh]}/{rooms[environment]}/{walk:02d}",
            replace(config, mesh=mesh, environment=environment, seed=config.seed + walk),
        )
        for mesh, environment, walk in product(objects, rooms, range(trajectories))
    )


def simulate_many(
    jobs: Sequence[SceneJob], folder: Path, engine: EngineConfig | None = None
) -> tuple[SceneResult, ...]:
    """Record every job that is not finished; one that fails is reported and does not stop the rest.

    Each scene ends as a line of ``folder``/results.jsonl; the summary, ``folder``/summary.json, is written at
    the end, also of an interrupted run.

    Args:
        jobs: from `plan_jobs` or `digs_warp.sim.record.randomize.draws.draw_scenes`.
        folder: of the data set.
        engine: where the scenes are recorded; None: one at a time on this machine.
    """
    folder = Path(folder)
    config = engine or EngineConfig()
    needs = needs_of(config)
    tasks = [_task(job, folder, needs) for job in jobs]
    done = Results(folder)
    for job, task in zip(jobs, tasks, strict=True):
        if done.is_done(task.key) and not is_finished(folder / job.name, job.config):
            done.forget(task.key)
    try:
        with started(config, folder) as workers:
            run_tasks(tasks, done, folder, workers, label="Scenes", unit="scene")
    finally:
        ended = [(job, done.records.get(task.key)) for job, task in zip(jobs, tasks, strict=True)]
        results = tuple(_result(job, record) for job, record in ended if record)
        write_atomically(folder / DATA_SET, to_json({"scenes": results}).encode())
    return results


def _task(job: SceneJob, folder: Path, needs: Needs) -> Task:
    key = digest([job.name, job.config])
    return Task(
        key, job.name, record_scene, (job, folder.resolve()), needs, facts={"name": job.name}
    )


def record_scene(job: SceneJob, folder: Path) -> dict[str, Any]:
    """Record a scene, or go on with it, and return the numbers of its `SceneResult`."""
    start = time.perf_counter()
    capture = simulate(job.config, folder / job.name, resume=True)
    seconds = time.perf_counter() - start
    fill, error_mm = judge_depth(capture)
    recorded = RecordedObject.find(folder / job.name)
    size = max(recorded.size) if recorded else None
    numbers = (len(capture), seconds, fill, error_mm, size)
    return dict(zip(NUMBERS, numbers, strict=True))


def _result(job: SceneJob, record: Mapping[str, Any]) -> SceneResult:
    drawn = job.drawn or None
    if "error" in record:
        error, failure = record["error"], record["failure"]
        return SceneResult(job.name, error, 0, 0.0, drawn=drawn, failure=failure)
    return SceneResult(job.name, "", **{name: record[name] for name in NUMBERS}, drawn=drawn)


def judge_depth(capture: Capture) -> tuple[float | None, float | None]:
    """Return the share of the object's pixels with depth, and the median absolute error there [mm].

    Either is None where no frame that is looked at shows the object, or none of it has depth.
    """
    chosen = spread(len(capture), JUDGED_FRAMES)
    errors = np.concatenate([_errors_on_object(capture.frames[i]) for i in chosen])
    if len(errors) == 0:
        return None, None
    known = errors[np.isfinite(errors)]
    fill = len(known) / len(errors)
    return fill, 1e3 * float(np.median(np.abs(known))) if len(known) else None


def _errors_on_object(frame: Frame) -> np.ndarray:
    """Return sensed minus true depth [m] of the pixels that show nothing but the object."""
    error = frame.load_depth() - frame.load_depth_true()
    return error[frame.load_mask() == 255]


def _named(paths: Sequence[Path | None], built_in: str) -> dict[Path | None, str]:
    """Return a name for every path: its stem, with its folder if stems are equal."""
    stems = [built_in if path is None else path.stem for path in paths]
    names = {
        path: stem if path is None or stems.count(stem) == 1 else f"{path.parent.name}-{path.name}"
        for path, stem in zip(paths, stems, strict=True)
    }
    twice = sorted({name for name in names.values() if list(names.values()).count(name) > 1})
    if twice:
        raise DigsError(f"scenes: several inputs would be called {', '.join(twice)}; rename them")
    return names
