"""The study runner, on cases that only compute a number: what is measured is the runner."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.engines import processes
from digs_warp.engines.config import EngineConfig
from digs_warp.engines.processes import Child
from digs_warp.engines.task import RESULTS, finished_file
from digs_warp.record.files import write_atomically
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.runner import run_cases
from digs_warp.study.engine.store import Store


def measure(case: Case, folder: Path) -> dict[str, Any]:
    """Square a number; some numbers misbehave. Leaves a trace of every call."""
    n = case.labels["n"]
    with open(folder / "calls.txt", "a", encoding="utf-8") as file:
        file.write(f"{n}\n")
    if n == 13 and not (folder / "lucky").exists():
        raise ValueError("thirteen")
    if n == 99:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(case.labels.get("seconds", 0.0))
    return {"metrics": {"square": n * n}, "threads_seen": os.environ["DIGS_WARP_THREADS"]}


def cases(*numbers: int, **labels: Any) -> list[Case]:
    return [Case(labels={"n": n, **labels}) for n in numbers]


def calls(folder: Path) -> list[int]:
    return [int(line) for line in (folder / "calls.txt").read_text().split()]


def test_every_case_is_measured_once(tmp_path: Path) -> None:
    outcome = run_cases(cases(3, 4), tmp_path, measure=measure)
    assert (outcome.done, outcome.failed, outcome.left_out) == (2, 0, 0)
    again = run_cases(cases(3, 4, 5), tmp_path, measure=measure)
    assert (again.done_before, again.done) == (2, 1)
    assert calls(tmp_path) == [3, 4, 5]
    squares = [record["metrics"]["square"] for record in Store(tmp_path).records.values()]
    assert squares == [9, 16, 25]


def test_failed_and_killed_cases_stop_no_other_and_what_dies_is_tried_again(tmp_path: Path) -> None:
    outcome = run_cases(cases(13, 99, 2), tmp_path, measure=measure)
    assert (outcome.done, outcome.failed) == (1, 2)
    assert calls(tmp_path) == [13, 99, 99, 2]  # an exception would come back
    thirteen, dead, fine = Store(tmp_path).records.values()
    assert (thirteen["failure"], thirteen["attempts"]) == ("error", 1)
    assert thirteen["error"] == "ValueError: thirteen"
    assert (dead["failure"], dead["attempts"]) == ("died", 2) and "SIGKILL" in dead["error"]
    assert "error" not in fine
    (tmp_path / "lucky").touch()
    assert run_cases(cases(13), tmp_path, measure=measure).done == 1
    assert "error" not in Store(tmp_path).records[thirteen["key"]]


def test_a_case_that_takes_too_long_is_ended(tmp_path: Path) -> None:
    run_cases(cases(2, seconds=60), tmp_path, measure=measure, engine=EngineConfig(case_time=0.5))
    (record,) = Store(tmp_path).records.values()
    assert (record["failure"], record["attempts"]) == ("time limit", 1)


def test_a_result_that_a_worker_left_is_taken(tmp_path: Path) -> None:
    """The run was killed between the end of the case and its line."""
    (case,) = cases(3)
    write_atomically(finished_file(tmp_path, case.key), b'{"metrics": {"square": 9}}')
    outcome = run_cases([case], tmp_path, measure=measure)
    assert (outcome.done_before, outcome.done) == (1, 0)
    assert Store(tmp_path).records[case.key]["metrics"] == {"square": 9}
    assert not finished_file(tmp_path, case.key).parent.exists()


def test_workers_share_the_cores(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DIGS_WARP_THREADS", "6")
    run_cases(cases(1, 2, 3), tmp_path, measure=measure, engine=EngineConfig(workers=3))
    assert {r["threads_seen"] for r in Store(tmp_path).records.values()} == {"2"}


def test_a_half_written_line_is_dropped_and_its_case_runs_again(tmp_path: Path) -> None:
    run_cases(cases(1, 2), tmp_path, measure=measure)
    path = tmp_path / RESULTS
    path.write_bytes(path.read_bytes()[:-20])
    assert [r["labels"]["n"] for r in Store(tmp_path).records.values()] == [1]
    run_cases(cases(1, 2), tmp_path, measure=measure)
    lines = path.read_text().splitlines()
    assert [json.loads(line)["labels"]["n"] for line in lines] == [1, 2]


def test_a_broken_line_in_the_middle_and_two_cases_with_one_key_are_refused(tmp_path: Path) -> None:
    (tmp_path / RESULTS).write_text('{"key": "a"}\nnonsense\n{"key": "b"}\n')
    with pytest.raises(DigsError, match="line 2"):
        Store(tmp_path)
    with pytest.raises(DigsError, match="labels"):
        run_cases(cases(1, 1), tmp_path / "other", measure=measure)


def start_two_cases(tmp_path: Path) -> "subprocess.Popen[bytes]":
    """Start a study of a short case and an endless one; return when the endless one has begun."""
    code = (
        "import signal, sys; sys.path[:0] = [sys.argv[1]]\n"
        # A shell's background jobs, and all that they start, ignore Ctrl-C.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from pathlib import Path\n"
        "from test_runner import cases, measure\n"
        "from digs_warp.study.engine.runner import run_cases\n"
        "if __name__ == '__main__':\n"
        "    todo = cases(1) + cases(2, seconds=600)\n"
        "    run_cases(todo, Path(sys.argv[2]), measure=measure)\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    arguments = [sys.executable, str(script), str(Path(__file__).parent), str(tmp_path)]
    process = subprocess.Popen(arguments, start_new_session=True, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not (tmp_path / "calls.txt").exists() or calls(tmp_path) != [1, 2]:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)
    return process


@pytest.mark.parametrize("cause", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_study_that_is_ended_keeps_what_is_done_and_leaves_no_worker(
    tmp_path: Path, cause: signal.Signals
) -> None:
    process = start_two_cases(tmp_path)
    if cause is signal.SIGINT:
        os.killpg(process.pid, cause)
    else:
        process.send_signal(cause)
    # The end of stderr comes when all who hold it are gone, the worker too.
    _, stderr = process.communicate(timeout=120)
    assert process.returncode == -cause or b"KeyboardInterrupt" in stderr
    assert [r["labels"]["n"] for r in Store(tmp_path).records.values()] == [1]


@pytest.fixture
def heeds_ctrl_c() -> Iterator[None]:
    """Heed SIGINT, which a process ignores that a shell has started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeds_ctrl_c")
def test_ctrl_c_while_a_case_begins_leaves_no_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = []

    class Interrupted(Child):
        def __init__(self, threads: int) -> None:
            super().__init__(threads)
            begun.append(self._process)
            os.kill(os.getpid(), signal.SIGINT)  # it reaches the main thread

    monkeypatch.setattr(processes, "Child", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_cases(cases(2, seconds=60), tmp_path, measure=measure)
    assert [process.poll() is None for process in begun] == [False]


def test_what_would_end_after_the_budget_is_not_begun(tmp_path: Path) -> None:
    outcome = run_cases(cases(2, 3, 4, seconds=0.4), tmp_path, measure=measure, budget=0.6)
    assert (outcome.done, outcome.left_out) == (1, 2)
