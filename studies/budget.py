"""`python -m studies budget`: what each stage of the demo takes, beside what the page says that it took.

The demo runs once in this process, with compiled kernels. Compare CPU seconds: they hardly depend on what
else the machine does.
"""

import re
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from digs_warp.cli import parse
from digs_warp.commands.precompile import compile_kernels
from digs_warp.record.run_log import RunLog, source_commit, timed
from scripts.page_marks import DOCS
from studies.results import Result

PAGE, MARK = "research/performance.md", "budget"
WALL, CPU, BUSY, BEFORE = "wall [s]", "CPU [s]", "cores busy", "CPU before [s]"


def bench_budget(arguments: str = "") -> list[Result]:
    """Return a row for each stage of `digs-warp run`, with ``arguments``, and for the whole."""
    commit = (source_commit() or "unknown")[:10]
    compile_kernels()
    before = recorded_cpu((DOCS / PAGE).read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder, stage_times() as (wall, cpu):
        command = parse(["run", "--out", str(Path(folder, "demo")), *arguments.split()])
        with timed(wall, "all"), timed(cpu, "all", time.process_time):
            command.execute()
    rows = []
    for stage in wall:
        values = {WALL: wall[stage], CPU: cpu[stage], BUSY: cpu[stage] / max(wall[stage], 1e-9)}
        then = {BEFORE: before[stage]} if stage in before else {}
        rows.append(Result({"stage": stage, "commit": commit}, values | then))
    return rows


@contextmanager
def stage_times() -> Iterator[tuple[dict[str, float], dict[str, float]]]:
    """Give wall and CPU seconds of what all logs of runs time in the block, by "command: stage"."""
    wall: dict[str, float] = {}
    cpu: dict[str, float] = {}
    stage = RunLog.stage

    @contextmanager
    def timed_stage(log: RunLog, name: str) -> Iterator[None]:
        key = f"{log.command}: {name}"
        with stage(log, name), timed(wall, key), timed(cpu, key, time.process_time):
            yield

    RunLog.stage = timed_stage  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield wall, cpu
    finally:
        RunLog.stage = stage


def recorded_cpu(page: str) -> Mapping[str, float]:
    """Return the CPU seconds in the table of a page, by stage."""
    found = re.search(rf"<!-- {MARK}: [^>]*-->\n(.*?)<!-- end -->", page, re.DOTALL)
    lines = re.findall(r"^\| (.*) \|$", found[1] if found else "", re.MULTILINE)
    rows = [[cell.strip() for cell in line.split("|")] for line in lines]
    if not rows:
        return {}
    place = rows[0].index(CPU)
    return {row[0]: float(row[place].replace(",", "")) for row in rows[2:]}
