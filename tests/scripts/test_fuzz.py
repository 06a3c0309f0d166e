"""The fuzzing command: damaged inputs of every kind are read or refused; defects are noticed."""

import json
import resource
from pathlib import Path

import pytest
from fuzz import fuzz, table
from fuzzing import worker as worker_module
from fuzzing.inputs import NOTE, Inputs
from fuzzing.kinds import KINDS, find_kinds
from fuzzing.originals import Originals
from fuzzing.worker import Job, Worker, run_input

from reference.planted_commands import planted
from reference.slow_to_import import slow_to_import


def test_planted_defects_are_noticed(tmp_path: Path) -> None:
    worker = Worker(lambda _: [], planted, seconds=2.0, megabytes=50.0)
    for line, end in (
        *(("read", "read"), ("refused", "refused"), ("stop", "refused")),
        *((defect, defect) for defect in ("traceback", "crash", "memory", "time")),
        ("read", "read"),  # by the process that replaced the one before
    ):
        outcome = worker.run(Job("planted", tmp_path, (line,)))
        assert outcome.end == end, (line, outcome.detail)
        assert outcome.is_defect == (end not in ("read", "refused"))
    worker.stop()


def test_the_start_of_a_process_does_not_count(tmp_path: Path) -> None:
    """Imports take 1 s of the processor here, and longer where it has other work, too."""
    worker = Worker(lambda _: [], slow_to_import, seconds=0.2)
    outcome = worker.run(Job("planted", tmp_path, ("read",)))
    worker.stop()
    assert outcome.end == "read", outcome.detail


def test_a_long_life_of_a_process_is_put_down_to_no_input(tmp_path: Path, monkeypatch) -> None:
    """Counted in ticks, what it took before is a little more."""
    limits: list[tuple[int, float]] = []
    monkeypatch.setattr(worker_module.time, "process_time", lambda: 1000.0)
    monkeypatch.setattr(worker_module, "_silence", lambda: None)
    monkeypatch.setattr(worker_module, "_limit", lambda kind, now, _: limits.append((kind, now)))
    monkeypatch.chdir(tmp_path)
    assert run_input(tmp_path, [""], lambda _: 0, 10.0).end == "read"
    assert dict(limits[:2])[resource.RLIMIT_CPU] >= 1100


@pytest.mark.long
def test_damaged_inputs_of_every_kind_are_read_or_refused(tmp_path: Path) -> None:
    """`python scripts/fuzz.py --count 556` does the same at length; see docs/research/stability.md."""
    tallies = fuzz(KINDS, count=1, seed=2026, keep=tmp_path / "kept")
    assert list(tallies) == [kind.name for kind in KINDS]
    assert not list(tmp_path.glob("kept/*")), table(tallies).text()
    assert all(len(outcomes) == 1 for outcomes in tallies.values())


@pytest.mark.long
def test_an_input_is_kept_with_its_faults(tmp_path: Path) -> None:
    (kind,) = find_kinds(["mesh: PLY"])
    originals = Originals(tmp_path / "originals")
    originals.folder.mkdir()
    inputs = Inputs(originals, tmp_path / "inputs", seed=0)
    worker = Worker(lambda _: inputs.healthy(kind))
    first = [worker.run(inputs.write(kind, number)) for number in range(4)]
    worker.stop()
    kept = [inputs.keep(kind, n, outcome, tmp_path / "kept") for n, outcome in enumerate(first)]
    assert [json.loads((each / NOTE).read_text())["end"] for each in kept] == [o.end for o in first]
    # The same faults in the same file; another number has other faults.
    other = inputs.write(kind, len(kind.inputs)).folder / kind.inputs[0].damaged
    file = kind.inputs[0].damaged
    assert (kept[0] / file).read_bytes() == (inputs.write(kind, 0).folder / file).read_bytes()
    assert (kept[0] / file).read_bytes() != other.read_bytes()
