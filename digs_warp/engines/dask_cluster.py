"""Workers of Dask: those of a cluster on this machine, or of one that runs already."""

import logging
import tempfile
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from dask import config as dask_config
from distributed import Client, LocalCluster

from digs_warp.checks import DigsError
from digs_warp.engines.engine import ONE_THREAD, Engine, Needs
from digs_warp.engines.processes import packed, run_apart
from digs_warp.words import counted

# Seconds until a scheduler answers, or is lost.
PATIENCE = 10

_log = logging.getLogger(__name__)


class DaskCluster(Engine):
    """The workers of a Dask scheduler; each thread of a worker waits for one call in a child.

    Args:
        address: of a scheduler to join; None: a cluster on this machine, which ends with the engine.
        workers: of that cluster; or how many calls to run at most at a time, None: one for every thread of
            the workers.
    """

    def __init__(self, address: str | None, workers: int | None) -> None:
        logging.getLogger("distributed").setLevel(logging.ERROR)  # it tells of every connection
        self._most = workers
        self._place = tempfile.TemporaryDirectory(prefix="digs-warp-dask-")
        self._cluster = _local_cluster(workers or 1, self._place.name) if address is None else None
        try:
            self._client = Client(self._cluster or address, timeout=PATIENCE, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            self._place.cleanup()
            raise DigsError(
                f"--engine dask:{address}: no scheduler of Dask answers there ({error}); start one with "
                "'dask scheduler', or correct the address"
            ) from error
        if address is not None:
            _log.info("Dask at %s: %s now", address, counted(self.slots, "slot"))

    @property
    def slots(self) -> int:
        """The threads of all workers that there are now, at least 1: workers may still come."""
        there = max(1, sum(each["nthreads"] for each in self._workers()))
        return there if self._most is None else min(there, self._most)

    def submit(
        self, fn: Callable[..., Any], /, *args: Any, needs: Needs = ONE_THREAD
    ) -> "Future[Any]":
        """Have ``fn(*args)`` called; see `Engine`. What is needed is asked for where workers declare it."""
        wanted = {"threads": needs.threads, "memory_gb": needs.memory_gb}
        declared = {name for each in self._workers() for name in each["resources"]}
        resources = {name: amount for name, amount in wanted.items() if name in declared and amount}
        executor = self._client.get_executor(pure=False, retries=0, resources=resources)
        return executor.submit(run_apart, packed(fn, *args), needs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster; one on this machine ends, and the calls that run on it."""
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()
        self._place.cleanup()

    def _workers(self) -> list[dict[str, Any]]:
        return list(self._client.scheduler_info(n_workers=-1)["workers"].values())


def _local_cluster(workers: int, place: str) -> LocalCluster:
    settings = {
        # A lost call is tried again by `digs_warp.engines.run`, as on every engine.
        "distributed.scheduler.allowed-failures": 0,
        # The worker only waits: the memory is that of its children.
        "distributed.worker.memory.terminate": False,
        "distributed.admin.large-graph-warning-threshold": "1GB",
    }
    with dask_config.set(settings):
        return LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,  # pyright: ignore[reportArgumentType] - no page
            local_directory=place,
            silence_logs=logging.ERROR,
        )
