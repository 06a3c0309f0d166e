"""Results of benchmarks: the table for people and the lines for programs tell the same."""

import importlib
import json
import re
from pathlib import Path

import pytest

from digs_warp.study.benchmarks import BENCHMARKS
from digs_warp.study.results import (
    Result,
    format_number,
    format_tables,
    read_json_lines,
    write_json_lines,
)

REPOSITORY = Path(__file__).resolve().parents[3]

RESULTS = [
    Result({"splats": 1000, "stage": "forward"}, {"time [ms]": 12.345678, "passes": 3}),
    Result({"splats": 1000, "stage": "backward"}, {"time [ms]": 1234.5}),
]


def test_json_lines_hold_exactly_the_results(tmp_path: Path) -> None:
    write_json_lines(RESULTS, tmp_path / "results.jsonl")
    assert read_json_lines(tmp_path / "results.jsonl") == RESULTS
    lines = (tmp_path / "results.jsonl").read_text().splitlines()
    assert list(json.loads(lines[0])) == ["labels", "values", "table"]


def test_the_table_names_shared_settings_once_and_aligns_its_columns() -> None:
    lines = format_tables(RESULTS).splitlines()
    assert lines[0] == "splats: 1000"
    header, rule, *rows = lines[2:]
    assert header.split() == ["stage", "time", "[ms]", "passes"]
    assert set(rule) == {"-", " "}
    assert [row.split() for row in rows] == [["forward", "12.35", "3"], ["backward", "1,234"]]
    assert rows[0].index("12.35") + 5 == rows[1].index("1,234") + 5


def test_no_results_make_no_table() -> None:
    assert format_tables([]) == "no results"


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.12345, "0.123"), (1.23456, "1.235"), (99.999, "100.00"), (123456.0, "123,456")]
    + [(12, "12"), (7_500_000, "7,500,000")],
)
def test_numbers_keep_about_four_digits(value: float, text: str) -> None:
    assert format_number(value) == text


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda benchmark: benchmark.name)
def test_every_benchmark_names_a_function_that_exists(benchmark) -> None:
    for function in filter(None, (benchmark.function, benchmark.chart_function)):
        module, _, name = function.partition(":")
        assert callable(getattr(importlib.import_module(f"digs_warp.study.{module}"), name))


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda benchmark: benchmark.name)
def test_every_benchmark_has_a_place_in_its_page(benchmark) -> None:
    assert f"<!-- {benchmark.name}" in (REPOSITORY / "docs" / benchmark.page).read_text()


def test_every_mark_of_a_page_is_filled_by_a_script_that_exists() -> None:
    names = {(benchmark.page, benchmark.name) for benchmark in BENCHMARKS}
    for page in (REPOSITORY / "docs").glob("*.md"):
        found = re.findall(r"<!-- ([^:>]+): written by (\S+) -->", page.read_text())
        for mark, script in found:
            assert (REPOSITORY / script).is_file(), (page, script)
            if script == "scripts/pages.py" and mark != "machine":
                assert (page.name, mark.split()[0]) in names, (page, mark)
