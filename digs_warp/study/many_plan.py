"""What thousands of scenes take: time by the laws of the scaling study, storage by a sample made now."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

from digs_warp.checks import DigsError
from digs_warp.study.engine.records import Record
from digs_warp.study.studies.scaling import BASE, LAWS, ONE_THREAD, Law, Load, fit, fit_values

# Stages that a reconstruction with the poses of the recording does not have, and what only a study does.
NOT_NEEDED = ("structure from motion", "scale", "compile kernels", "measure course")

TERMS = {
    "record": ("frames", "frame pixels"),
    "reconstruct": ("frames", "frame pixels", "splats", "steps", "step pixels", "step splats"),
}

SAMPLE_FRAMES, SAMPLE_STEPS = 4, 5


@dataclass(frozen=True)
class Stored:
    """Bytes on disk of one scene."""

    recording: float
    reconstruction: float


@dataclass(frozen=True)
class Prediction:
    """What one scene takes on one thread.

    Attributes:
        record: time of the recording [s].
        reconstruct: time of the reconstruction [s], with the poses of the recording.
        memory: peak of a process that does both [MB].
        misses: median relative error of each law over the measurements.
    """

    record: float
    reconstruct: float
    memory: float
    misses: dict[str, float]


def predict(records: Sequence[Record], load: Load) -> Prediction:
    """Return what a scene takes.

    The laws hold for the threads that the study had; the share that its base case took longer on one
    thread is added.

    Args:
        records: of the scaling study; with the base case on one thread.
        load: the work of a scene.

    Raises:
        DigsError: the base case is missing, on one thread or on all.
    """
    usual = [record for record in records if record["labels"]["curve"] != ONE_THREAD]
    single = [record for record in records if record["labels"]["curve"] == ONE_THREAD]
    base = [record for record in usual if _is_base(record)]
    if not single or not base:
        raise DigsError(
            "the study has no base case on one thread, or on all; measure it with 'digs-warp study run "
            "scaling'"
        )
    seconds, misses = {}, {}
    for part, terms in TERMS.items():
        law = fit_values([(record, seconds_of(record, part)) for record in usual], terms)
        slower = median(seconds_of(r, part) for r in single) / median(
            seconds_of(r, part) for r in base
        )
        seconds[part] = law.at(load) * slower
        misses[part] = law.miss
    memory: Law = fit(usual, "memory", LAWS["memory"])
    return Prediction(seconds["record"], seconds["reconstruct"], memory.at(load), misses)


def seconds_of(record: Record, part: str) -> float:
    """Return the time [s] of all stages that count for ``part``, "record" or "reconstruct"."""
    stages = record["recording_seconds"] if part == "record" else record["seconds"]
    return sum(value for stage, value in stages.items() if stage not in NOT_NEEDED)


def sample_storage(load: Load) -> Stored:
    """Record and reconstruct a few frames of the built-in object, and scale their bytes to a scene.

    Files of Gaussians and points grow with the splats, all others with the frames.
    """
    from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
    from digs_warp.sim.config import SimulateConfig
    from digs_warp.sim.record.record import simulate

    settings = SimulateConfig(frames=SAMPLE_FRAMES, width=load.width, height=load.height)
    config = ReconstructConfig(test_every=2)
    stop = replace(config.train.stop, iterations=SAMPLE_STEPS)
    config = replace(config, train=replace(config.train, stop=stop))
    with tempfile.TemporaryDirectory(prefix="digs-warp-plan-") as place:
        capture = simulate(settings, Path(place, "capture"))
        result = reconstruct(capture, config, Path(place, "reconstruction"))
        recording = _bytes(Path(place, "capture"))
        folder = Path(place, "reconstruction")
        arrays = sum(path.stat().st_size for path in folder.rglob("*.npz"))
        rest = _bytes(folder) - arrays
    more_frames = load.frames / SAMPLE_FRAMES
    more_splats = load.splats / len(result.gaussians)
    return Stored(recording * more_frames, arrays * more_splats + rest * more_frames)


def _is_base(record: Record) -> bool:
    return record["labels"]["curve"] == "base" and all(
        record["labels"][name] == value for name, value in BASE.items()
    )


def _bytes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
