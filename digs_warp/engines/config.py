"""The flags of every command that makes many calls: which engine, and what each call may use."""

from dataclasses import dataclass
from typing import Annotated

from digs_warp.checks import DigsError
from digs_warp.record.durations import DURATION
from digs_warp.settings import MANY, SECONDS, Range, Settings
from digs_warp.words import did_you_mean

LOCAL, DASK, SLURM, SUBMITIT_LOCAL = "local", "dask", "slurm", "submitit-local"
ENGINES = (LOCAL, DASK, SLURM, SUBMITIT_LOCAL)


@dataclass(frozen=True, kw_only=True)
class EngineConfig(Settings):
    """Where many calls run."""

    engine: str = LOCAL
    """Where the cases run: local (processes on this machine), dask (a cluster of Dask on this machine),
    dask:ADDRESS (one that runs already, for example dask:tcp://10.0.0.1:8786), slurm (one job each), or
    submitit-local (as slurm, but on this machine, to try it)."""

    workers: Annotated[int | None, Range(1, 1024)] = None
    """Cases at the same time. Default: 1 for local, one per core for dask, all that there are for
    dask:ADDRESS, 64 jobs for slurm."""

    case_threads: Annotated[int | None, Range(1, 1024)] = None
    """CPU threads of each case. Default: the cores of this machine shared by the workers; 1 on other
    machines."""

    case_memory: Annotated[float | None, Range(1e-3, MANY)] = None
    """Memory of each case [GB]: this machine starts no more cases than fit, a cluster is asked for it.
    Default: not asked for."""

    case_time: Annotated[float | None, DURATION, SECONDS] = None
    """End a case that takes longer than this, for example 20min. Default: never; 1h for slurm."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.kind not in ENGINES or (self.address is not None and self.kind != DASK):
            raise DigsError(
                f"--engine {self.engine}: not an engine{did_you_mean(self.kind, ENGINES)}; only dask takes "
                "an address, as in dask:tcp://10.0.0.1:8786"
            )
        if self.address == "":
            raise DigsError("--engine dask: no address after the colon; leave it out, or add one")

    @property
    def kind(self) -> str:
        """The engine without its address."""
        return self.engine.partition(":")[0]

    @property
    def address(self) -> str | None:
        """Of the scheduler to join; None: there is none."""
        _, colon, address = self.engine.partition(":")
        return address if colon else None
