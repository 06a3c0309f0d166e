"""What an engine is, what a call asks it for, and how a call can fail."""

from abc import abstractmethod
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from digs_warp.checks import DigsError


@dataclass(frozen=True)
class Needs:
    """What one call may use.

    Attributes:
        threads: CPU threads, >= 1.
        memory_gb: memory [GB]; None: unknown, nothing is asked for.
        seconds: the call is ended after this time [s]; None: never.
        alone: it gets a new process, whose peak memory is its own.
    """

    threads: int = 1
    memory_gb: float | None = None
    seconds: float | None = None
    alone: bool = False


class FailureClass(StrEnum):
    """Why a call has no result."""

    ERROR = "error"  # it raised an exception
    OUT_OF_MEMORY = "out of memory"  # it raised MemoryError, or a batch system says so
    DIED = "died"  # its process ended, by a signal or with an exit code
    TIME_LIMIT = "time limit"  # it took longer than it may
    WORKER_LOST = "worker lost"  # the engine's worker ended, or its machine cannot be reached


ONE_THREAD = Needs()

# What can go well the second time. An exception and a time limit come back.
RETRIED = (FailureClass.DIED, FailureClass.WORKER_LOST)


class CallFailed(Exception):
    """A call on an engine has no result; it can be pickled, as engines send it between machines."""

    def __init__(self, kind: FailureClass, message: str) -> None:
        super().__init__(kind, message)
        self.kind = kind
        self.message = message

    def __str__(self) -> str:
        return self.message


class EngineLost(DigsError):
    """What distributes the calls is gone, such as Dask's scheduler. What is done is kept."""


class Engine(Executor):
    """An executor of `concurrent.futures` that makes calls in other processes, here or on other machines.

    The future of a call raises `CallFailed` when the call has no result; an engine may raise other exceptions
    when one of its own workers is lost. Calls share files, not memory.
    """

    @property
    @abstractmethod
    def slots(self) -> int:
        """How many calls can run at the same time now, >= 1."""

    @abstractmethod
    def submit(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, fn: Callable[..., Any], /, *args: Any, needs: Needs = ONE_THREAD
    ) -> "Future[Any]":
        """Have ``fn(*args)`` called; both can be pickled, and ``fn`` is at module level."""
