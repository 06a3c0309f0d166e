"""Starts the engine that the flags name."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.device.threads import default_threads
from digs_warp.engines.config import DASK, LOCAL, SLURM, SUBMITIT_LOCAL, EngineConfig
from digs_warp.engines.engine import Engine, Needs
from digs_warp.engines.processes import LocalProcesses

JOBS = 64  # of a batch system at the same time
JOB_SECONDS = 3600.0  # batch systems end a job after a time that has to be said


def needs_of(config: EngineConfig) -> Needs:
    """Return what each call may use where the call itself does not say."""
    threads = config.case_threads or (
        max(1, default_threads() // _workers_here(config)) if _is_here(config) else 1
    )
    seconds = config.case_time or (JOB_SECONDS if config.kind in (SLURM, SUBMITIT_LOCAL) else None)
    return Needs(threads, config.case_memory, seconds)


@contextmanager
def started(config: EngineConfig, folder: Path) -> Iterator[Engine]:
    """Yield the engine; at the end what still runs on it is ended.

    Args:
        config: which one.
        folder: of the results; batch systems leave their logs in it. Other machines see it under this name.

    Raises:
        DigsError: its packages are not installed, or no scheduler answers.
        EngineLost: it was lost.
    """
    engine = _start(config, folder)
    try:
        yield engine
    finally:
        engine.shutdown(cancel_futures=True)


def _start(config: EngineConfig, folder: Path) -> Engine:
    if config.kind == LOCAL:
        return LocalProcesses(_workers_here(config))
    _check_installed(config.engine, "distributed" if config.kind == DASK else "submitit")
    if config.kind == DASK:
        from digs_warp.engines.dask_cluster import DaskCluster

        workers = _workers_here(config) if config.address is None else config.workers
        return DaskCluster(config.address, workers)
    from digs_warp.engines.batch_jobs import BatchJobs

    if config.kind == SLURM:
        return BatchJobs("slurm", config.workers or JOBS, folder)
    return BatchJobs("local", _workers_here(config), folder)


def _check_installed(engine: str, package: str) -> None:
    if find_spec(package) is None:
        raise DigsError(
            f"--engine {engine}: the package {package} is not installed; pip install 'digs-warp[cluster]'"
        )


def _is_here(config: EngineConfig) -> bool:
    return config.kind != SLURM and config.address is None


def _workers_here(config: EngineConfig) -> int:
    """Return how many workers this machine gets: as many as asked for, unless their memory does not fit."""
    if config.workers is not None:
        wanted = config.workers
    else:
        wanted = default_threads() // (config.case_threads or 1) if config.kind == DASK else 1
    fitting = int(_memory_gb() / config.case_memory) if config.case_memory else wanted
    return max(1, min(wanted, fitting))


def _memory_gb() -> float:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
