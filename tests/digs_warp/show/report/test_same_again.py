"""The command in the report sets what the run was told, and nothing else."""

from dataclasses import replace

import pytest

from digs_warp.commands.parse import CommonFlags, read_command
from digs_warp.commands.run import Run
from digs_warp.record.run_log import RunLog, RunRecord
from digs_warp.show.report.run_section import RunRecords

FLAGS = {
    "nothing": "",
    "numbers, words": "--frames 16 --width 320 --iterations 9 --tier law --subject scene --density adaptive",
    "lists and switches": "--elevations 10 35.5 --seed 7 --keep-course --scene a.glb b.obj",
}


def records_of(run: Run) -> RunRecords:
    reconstruction = run.reconstruct_config(run.recording.seed)
    simulated = RunLog("simulate", run.recording).record()
    return RunRecords(
        simulated,
        RunLog("reconstruct", reconstruction).record(),
        RunRecord("run", {}, {}),
        "capture",
    )


@pytest.mark.parametrize("flags", FLAGS.values(), ids=FLAGS)
def test_the_command_does_the_same_again(flags: str) -> None:
    run = read_command(["run", "--out", "again", *flags.split()], CommonFlags())
    assert isinstance(run, Run)
    ((program, *words),) = records_of(run).commands()
    assert program == "digs-warp"
    assert read_command(words, CommonFlags()) == run
    assert len(words) <= 3 + len(flags.split())


def test_what_has_no_flag_comes_from_the_record() -> None:
    run = read_command(["run", "--out", "again"], CommonFlags())
    assert isinstance(run, Run)
    init = replace(run.init, edge_filter=False)
    ((*_, flag, file),) = records_of(replace(run, init=init)).commands()
    assert (flag, file) == ("--config", "run.json")
