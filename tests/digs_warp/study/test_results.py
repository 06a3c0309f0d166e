"""Results of benchmarks: the table for people and the lines for programs tell the same."""

import importlib
import json
from pathlib import Path

import pytest

from digs_warp.study.benchmarks import BENCHMARKS
from digs_warp.study.results import Result, format_number, format_table, write_json_lines

RESULTS = [
    Result("forward", 12.345678, "ms", {"splats": 1000, "threads": 1}),
    Result("backward", 1234.5, "ms", {"splats": 1000, "threads": 2}),
]


def test_json_lines_hold_exactly_the_results(tmp_path: Path) -> None:
    write_json_lines(RESULTS, tmp_path / "results.jsonl")
    lines = (tmp_path / "results.jsonl").read_text().splitlines()
    assert [Result(**json.loads(line)) for line in lines] == RESULTS
    assert list(json.loads(lines[0])) == ["name", "value", "unit", "settings"]


def test_the_table_names_shared_settings_once_and_aligns_its_columns() -> None:
    lines = format_table(RESULTS).splitlines()
    assert lines[0] == "splats: 1000"
    header, rule, *rows = lines[2:]
    assert header.split() == ["name", "threads", "value", "unit"]
    assert set(rule) == {"-", " "}
    assert [row.split() for row in rows] == [
        ["forward", "1", "12.35", "ms"],
        ["backward", "2", "1,234", "ms"],
    ]
    assert len({row.index("ms") for row in rows}) == 1


def test_no_results_make_no_table() -> None:
    assert format_table([]) == "no results"


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.12345, "0.123"), (1.23456, "1.235"), (99.999, "100.00"), (123456.0, "123,456")],
)
def test_numbers_keep_about_four_digits(value: float, text: str) -> None:
    assert format_number(value) == text


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda benchmark: benchmark.name)
def test_every_benchmark_names_a_function_that_exists(benchmark) -> None:
    module, _, name = benchmark.function.partition(":")
    assert callable(getattr(importlib.import_module(module), name))
