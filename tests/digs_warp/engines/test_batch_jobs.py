"""Jobs of submitit on this machine: what Slurm would do, without Slurm."""

import os
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.engines.config import EngineConfig
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.runner import run_cases
from digs_warp.study.engine.store import Store

pytest.importorskip("submitit", reason="submitit is not installed: extra cluster")

ENGINE = EngineConfig(engine="submitit-local", workers=3, case_threads=2)


def measure(case: Case, folder: Path) -> dict[str, Any]:
    """Square a number; 13 raises, 99 kills the job that it runs in, once."""
    n = case.labels["n"]
    if n == 13:
        raise ValueError("thirteen")
    if n == 99 and not (folder / "killed").exists():
        (folder / "killed").touch()
        os.kill(os.getppid(), signal.SIGKILL)
        signal.pause()
    return {"metrics": {"square": n * n}, "threads_seen": os.environ["DIGS_WARP_THREADS"]}


def test_jobs_answer_fail_and_are_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Seconds that submitit waits for the answer of a job that is gone; network drives need them.
    monkeypatch.setattr("submitit.Job._results_timeout_s", 0.5)
    cases = [Case(labels={"n": n}) for n in (3, 13, 99)]
    outcome = run_cases(cases, tmp_path, measure=measure, engine=ENGINE)
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
            [Case(labels={"n": 3})], tmp_path, measure=measure, engine=EngineConfig(engine="slurm")
        )
