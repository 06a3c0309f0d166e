"""The budget of the demo: both clocks of each stage, and what the page recorded."""

import time

from digs_warp.record.run_log import RunLog
from studies.budget import recorded_cpu, stage_times
from studies.results import Result, tables


def test_a_stage_is_timed_by_both_clocks() -> None:
    before = RunLog.stage
    with stage_times() as (wall, cpu):
        log = RunLog("run", {})
        with log.stage("sleep"):
            time.sleep(0.1)
    assert wall["run: sleep"] >= 0.1 > 0.09 > cpu["run: sleep"]
    assert log.seconds["sleep"] >= 0.1
    assert RunLog.stage is before


def test_the_page_tells_what_a_stage_took() -> None:
    labels = [{"stage": f"run: {name}", "commit": "c"} for name in ("simulate", "export")]
    rows = [Result(each, {"wall [s]": 2.0, "CPU [s]": 123.5}) for each in labels]
    table = tables(rows)[0].markdown()
    page = f"before\n<!-- budget: written by x -->\n{table}\n<!-- end -->\n| a | b |\n"
    assert recorded_cpu(page) == {"run: simulate": 123.5, "run: export": 123.5}
    assert recorded_cpu("<!-- budget: written by x -->\n<!-- end -->\n") == {}
