"""Real clusters on this machine: Dask, whose workers and scheduler are killed, and jobs of submitit."""

import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.engines.config import EngineConfig
from digs_warp.engines.engine import EngineLost
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.runner import run_cases
from digs_warp.study.engine.store import Store

pytest.importorskip("distributed", reason="dask and distributed are not installed: extra cluster")

KILLER, HOPELESS = 3, 4


def measure(case: Case, folder: Path) -> dict[str, Any]:
    """Draw some numbers, and kill what the study's folder says. Leaves a trace of every call."""
    n = case.labels["n"]
    with open(folder / "calls.txt", "a", encoding="utf-8") as file:
        file.write(f"{n}\n")
    target = folder / "kill.txt"
    if n == KILLER and target.exists():
        number = (
            int(target.read_text()) or os.getppid()
        )  # 0: the worker that waits for this process
        target.unlink()
        os.kill(number, signal.SIGKILL)
        time.sleep(1.0)  # our own end comes with that of the worker
    if n == HOPELESS and (folder / "hopeless").exists():
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60)
    values = np.random.default_rng(n).normal(size=1000)
    return {"metrics": {"mean": float(values.mean()), "last": float(values[-1])}}


CASES = [Case(labels={"n": n}) for n in range(6)]


def calls(folder: Path) -> list[int]:
    return sorted(int(line) for line in (folder / "calls.txt").read_text().split())


def numbers(folder: Path) -> dict[str, Any]:
    """What was measured, without the seconds."""
    records = Store(folder).records.items()
    return {key: {k: v for k, v in r.items() if k != "case_seconds"} for key, r in records}


@pytest.fixture(scope="module")
def of_one_process(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("one")
    assert run_cases(CASES, folder, measure=measure, engine=EngineConfig(case_threads=1)).done == 6
    return numbers(folder)


@pytest.mark.long
def test_a_worker_that_is_killed_changes_nothing(
    tmp_path: Path, of_one_process: dict[str, Any], caplog
) -> None:
    engine = EngineConfig(engine="dask", workers=2, case_threads=1)
    (tmp_path / "kill.txt").write_text("0")
    (tmp_path / "hopeless").touch()
    outcome = run_cases(CASES, tmp_path, measure=measure, engine=engine)
    assert (outcome.done, outcome.failed) == (5, 1)
    hopeless = Store(tmp_path).records[CASES[HOPELESS].key]
    assert (hopeless["failure"], hopeless["attempts"]) == ("worker lost", 2)
    news = [each for each in caplog.records if each.name.startswith("distributed")]
    assert [each.message for each in news if each.levelno < logging.ERROR] == []
    # Its neighbor on the other worker is none the worse.
    assert calls(tmp_path) == [0, 1, 2, 3, 3, 4, 4, 5]
    (tmp_path / "hopeless").unlink()
    run_cases(CASES, tmp_path, measure=measure, engine=EngineConfig(case_threads=1))
    assert numbers(tmp_path) == of_one_process


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, int]]:
    """A scheduler with two workers, as a user starts them: its address and process."""
    address_file = folder / "scheduler.json"
    address_file.unlink(missing_ok=True)
    shared = ["--scheduler-file", str(address_file)]
    quiet = ["--host", "127.0.0.1", "--no-dashboard"]
    with ExitStack() as stack:

        def start(*words: str) -> int:
            command = [
                sys.executable,
                "-m",
                "distributed.cli.dask_" + words[0],
                *words[1:],
                *shared,
            ]
            log = stack.enter_context((folder / "dask.log").open("ab"))
            process = subprocess.Popen(command, cwd=folder, stdout=log, stderr=log)
            stack.callback(process.wait)
            stack.callback(process.terminate)
            return process.pid

        scheduler = start("scheduler", *quiet, "--port", "0")
        deadline = time.monotonic() + 120
        while not address_file.exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        for _ in range(2):  # now, for they wait 5 seconds only
            start("worker", *quiet, "--nthreads", "1", "--no-nanny", "--death-timeout", "5")
        yield json.loads(address_file.read_text())["address"], scheduler


@pytest.mark.long
def test_a_scheduler_that_is_killed_loses_nothing(
    tmp_path: Path, of_one_process: dict[str, Any]
) -> None:
    with cluster(tmp_path) as (address, scheduler):
        (tmp_path / "kill.txt").write_text(str(scheduler))
        with pytest.raises(EngineLost, match="run the same command again"):
            run_cases(
                CASES, tmp_path, measure=measure, engine=EngineConfig(engine=f"dask:{address}")
            )
    done = set(Store(tmp_path).records)
    assert 0 < len(done) < len(CASES)
    with cluster(tmp_path) as (address, _):
        outcome = run_cases(
            CASES, tmp_path, measure=measure, engine=EngineConfig(engine=f"dask:{address}")
        )
    assert outcome.failed == 0
    assert outcome.done_before >= len(done)
    assert numbers(tmp_path) == of_one_process
    repeated = [n for n in range(6) if calls(tmp_path).count(n) > 1]
    assert not any(CASES[n].key in done for n in repeated)


def test_an_address_where_nobody_answers_is_named(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("digs_warp.engines.dask_cluster.PATIENCE", 1)
    with pytest.raises(DigsError, match=r"dask:tcp://127.0.0.1:1: no scheduler of Dask answers"):
        run_cases(
            CASES, tmp_path, measure=measure, engine=EngineConfig(engine="dask:tcp://127.0.0.1:1")
        )


pytest.importorskip("submitit", reason="submitit is not installed: extra cluster")

JOBS = EngineConfig(engine="submitit-local", workers=3, case_threads=2)


def measure_or_die(case: Case, folder: Path) -> dict[str, Any]:
    """Square a number; 13 raises, 99 kills the job that it runs in, once."""
    n = case.labels["n"]
    if n == 13:
        raise ValueError("thirteen")
    if n == 99 and not (folder / "killed").exists():
        (folder / "killed").touch()
        os.kill(os.getppid(), signal.SIGKILL)
        signal.pause()
    return {"metrics": {"square": n * n}, "threads_seen": os.environ["DIGS_WARP_THREADS"]}


def test_jobs_answer_fail_and_are_tried_again(tmp_path: Path, monkeypatch) -> None:
    # Seconds that submitit waits for the answer of a job that is gone; network drives need them.
    monkeypatch.setattr("submitit.Job._results_timeout_s", 0.5)
    cases = [Case(labels={"n": n}) for n in (3, 13, 99)]
    outcome = run_cases(cases, tmp_path, measure=measure_or_die, engine=JOBS)
    assert (outcome.done, outcome.failed) == (2, 1)
    records = {r["labels"]["n"]: r for r in Store(tmp_path).records.values()}
    assert (records[13]["error"], records[13]["failure"]) == ("ValueError: thirteen", "error")
    assert (tmp_path / "killed").exists()
    assert records[99]["metrics"] == {"square": 9801}
    assert {records[n]["threads_seen"] for n in (3, 99)} == {"2"}


@pytest.mark.skipif(shutil.which("sbatch") is not None, reason="there is a Slurm here")
def test_without_slurm_the_error_says_where_to_run_it(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="where 'sbatch' works"):
        run_cases(
            [Case(labels={"n": 3})],
            tmp_path,
            measure=measure_or_die,
            engine=EngineConfig(engine="slurm"),
        )
