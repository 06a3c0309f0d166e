"""Processes on this machine: what is finished is taken and removed, and no more run than have memory."""

import signal
from pathlib import Path
from typing import Any

import pytest

from digs_warp.engines import processes, start
from digs_warp.engines.config import EngineConfig
from digs_warp.engines.run import run_tasks
from digs_warp.engines.task import FINISHED, Results, Task, finished_file, perform


def count(calls: Path) -> dict[str, Any]:
    """Leaves a line of every call."""
    with calls.open("a", encoding="utf-8") as file:
        file.write("called\n")
    return {"calls": len(calls.read_text().splitlines())}


def test_finished_results_are_taken_and_removed(tmp_path: Path) -> None:
    calls = tmp_path / "calls.txt"
    left, done, new = (Task(key, key, count, (calls,)) for key in ("left", "done", "new"))
    for task in (left, left, done):  # an earlier run did not hear of the first two
        perform(finished_file(tmp_path, task.key), task.function, task.arguments)
    results = Results(tmp_path)
    results.add({"key": "done", "calls": 7})
    with start.started(EngineConfig(), tmp_path) as engine:
        outcome = run_tasks([left, done, new], results, tmp_path, engine)
    assert (outcome.done_before, outcome.done) == (2, 1)
    found = {key: record["calls"] for key, record in Results(tmp_path).records.items()}
    assert found == {"left": 1, "done": 7, "new": 3}
    assert not (tmp_path / FINISHED).exists()


@pytest.mark.parametrize(("memory_gb", "slots"), [(100.0, 4), (9.0, 2), (1.0, 1)])
def test_no_more_calls_run_than_have_memory(
    tmp_path: Path, monkeypatch, memory_gb: float, slots: int
) -> None:
    monkeypatch.setattr(start, "_memory_gb", lambda: memory_gb)
    with start.started(EngineConfig(workers=4, case_memory=4.0), tmp_path) as engine:
        assert engine.slots == slots


def test_a_process_that_handles_the_signal_and_goes_on_is_killed(monkeypatch) -> None:
    monkeypatch.setattr(processes, "GRACE", 0.2)
    child = processes.Child(1)
    child.result(processes.packed(signal.signal, signal.SIGTERM, signal.SIG_IGN), 60.0)
    child.stop()
    assert not child.is_alive
