"""Many recordings or reconstructions in one command, each in its own folder."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.checks import DigsError
from digs_warp.commands.output import OutputFolder
from digs_warp.commands.precompile import compile_kernels
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.engines.config import EngineConfig
from digs_warp.record import layout
from digs_warp.record.run_log import RunLog
from digs_warp.words import counted, format_facts

if TYPE_CHECKING:
    from digs_warp.commands.reconstruction_options import ReconstructionOptions


def make_many(
    output: OutputFolder,
    log: RunLog,
    engine: EngineConfig,
    inputs: Sequence[Path | None],
    make: Callable[[Path], Mapping[str, str | DigsError]],
    thing: str,
    listed: str,
) -> str:
    """Make many things in one folder, with a record; return what to print.

    ``make`` fills the folder, and returns what became of each by name, an error if it failed; each is called
    ``thing``, and the file ``listed`` has more. ``inputs`` are as of `OutputFolder.opened`.

    Raises:
        DigsError: some failed; what was made stays, but replaces no old result.
    """
    with output.opened(inputs) as folder:
        record = folder / layout.RUN_RECORD
        if output.resume:
            log.continue_from(record)
        log.save(record)
        if engine.address is None:
            compile_kernels()
        with log.stage(log.command):
            found = make(folder)
        failed = [name for name, words in found.items() if isinstance(words, DigsError)]
        log.results = {f"{thing}s": len(found), "failed": failed}
        log.save(record)
        lines = format_facts({name: str(words) for name, words in found.items()})
        if failed:
            number = counted(len(found), thing)
            text = f"{lines}\n\nAlso in {folder / listed}"
            raise DigsError(f"{len(failed)} of {number} failed\n{text}")
    seconds = log.seconds[log.command]
    number = counted(len(found), thing)
    return f"{lines}\n\nAlso in {output.out / listed}. {number} in {seconds:.0f} s"


@dataclass(frozen=True)
class CaptureJob:
    """One reconstruction of many.

    Attributes:
        name: its folder below that of the results.
        capture: the folder of the recording, absolute.
    """

    name: str
    capture: Path


def is_data_set(folder: Path) -> bool:
    """Whether a folder holds captures that 'digs-warp simulate' wrote, and is none itself."""
    return (folder / layout.DATA_SET).is_file() and not (folder / INDEX_NAME).is_file()


def find_jobs(sources: Sequence[Path]) -> tuple[CaptureJob, ...]:
    """Return a job for each capture, named by what its path does not share with those of the others.

    Args:
        sources: captures, or folders of 'digs-warp simulate' with many scenes.
    """
    captures: list[Path] = []
    for source in sources:
        inside = sorted(path.parent for path in source.rglob(INDEX_NAME))
        if is_data_set(source) and not inside:
            raise DigsError(f"data set '{source}': no capture in it has an index ({INDEX_NAME})")
        captures += inside if is_data_set(source) else [source]
    found = [path.resolve() for path in captures]
    twice = sorted({str(path) for path in found if found.count(path) > 1})
    if twice:
        raise DigsError(f"CAPTURE: given twice: {', '.join(twice)}; name each once")
    shared = Path(os.path.commonpath([path.parent for path in found]))
    return tuple(CaptureJob(path.relative_to(shared).as_posix(), path) for path in found)


def reconstruct_many(
    jobs: Sequence[CaptureJob],
    options: "ReconstructionOptions",
    seed: int,
    folder: Path,
    engine: EngineConfig,
) -> list[dict[str, Any]]:
    """Reconstruct every capture that is not finished; one that fails is reported and does not stop the rest.

    Args:
        jobs: from `find_jobs`.
        options: of all of them; what is "auto" is decided for each.
        seed: decides everything random.
        folder: of the results; each ends as a line of its results.jsonl.
        engine: where they run.

    Returns:
        The lines, in the order of ``jobs``.
    """
    from digs_warp.engines.run import run_tasks
    from digs_warp.engines.start import needs_of, started
    from digs_warp.engines.task import Results, Task
    from digs_warp.pipeline.records import is_finished
    from digs_warp.record.files import digest

    folder = folder.resolve()
    needs = needs_of(engine)
    done = Results(folder)
    tasks: list[Task] = []
    for job in jobs:
        key = digest([job.name, job.capture, options, seed])
        facts = {"name": job.name, "capture": str(job.capture)}
        arguments = (job, options, seed, folder)
        tasks.append(Task(key, job.name, reconstruct_job, arguments, needs, facts=facts))
        if done.is_done(key) and not is_finished(folder / job.name):
            done.forget(key)
    with started(engine, folder) as workers:
        run_tasks(tasks, done, folder, workers, label="Captures", unit="capture")
    return [done.records[task.key] for task in tasks]


def reconstruct_job(
    job: CaptureJob, options: "ReconstructionOptions", seed: int, folder: Path
) -> Mapping[str, Any]:
    """Reconstruct a capture, or go on with it; return the result in words and numbers."""
    from digs_warp.commands.reconstruction_options import reconstruction_words
    from digs_warp.data.capture import read_capture
    from digs_warp.pipeline.reconstruct import reconstruct

    start = time.perf_counter()
    capture = read_capture(job.capture)
    config = options.reconstruct_config(seed, capture)
    place = folder / job.name
    result = reconstruct(capture, config, place, resume=(place / layout.RUN_RECORD).is_file())
    return {
        "words": reconstruction_words(result, len(capture)),
        "frames": len(capture),
        "gaussians": len(result.gaussians),
        "scores": result.scores.mean.to_json(),
        "seconds": time.perf_counter() - start,
    }
