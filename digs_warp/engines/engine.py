"""The one seam: an engine is an executor of `concurrent.futures` that also says what a call may use."""

from abc import abstractmethod
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.engines.needs import ONE_THREAD, Needs


class EngineLost(DigsError):
    """What distributes the calls is gone, such as Dask's scheduler. What is done is kept."""


class Engine(Executor):
    """Makes calls in other processes, here or on other machines.

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
