"""Results of benchmarks: the table for people and the lines for programs tell the same."""

import importlib
import json
import re
from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from scripts.page_marks import DOCS
from studies.benchmarks import BENCHMARKS, Benchmark, find_benchmark
from studies.pages import PAGES
from studies.results import Result, format_number, format_tables, write_json_lines

RESULTS = [
    Result({"splats": 1000, "stage": "forward"}, {"time [ms]": 12.345678, "passes": 3}),
    Result({"splats": 1000, "stage": "backward"}, {"time [ms]": 1234.5}),
]


def test_json_lines_hold_exactly_the_results(tmp_path: Path) -> None:
    write_json_lines(RESULTS, tmp_path / "results.jsonl")
    lines = (tmp_path / "results.jsonl").read_text().splitlines()
    assert [Result(**json.loads(line)) for line in lines] == RESULTS


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
def test_every_benchmark_names_functions_and_pages_that_exist(benchmark: Benchmark) -> None:
    names = benchmark.functions
    for module, _, name in (each.rpartition(".") for each in names):
        assert callable(getattr(importlib.import_module(f"studies.{module}"), name))
    for page in benchmark.pages:
        assert f"<!-- {benchmark.name}" in (DOCS / page).read_text(encoding="utf-8")


def test_every_mark_of_a_page_is_filled_by_something_that_exists() -> None:
    known = {(page, each.name) for each in BENCHMARKS for page in each.pages}
    for page in DOCS.rglob("*.md"):
        for mark, writer in re.findall(r"<!-- ([^:>]+): written by (.+?) -->", page.read_text()):
            if writer.startswith("scripts/"):
                assert (DOCS.parent / writer).is_file(), (page, writer)
                continue
            name = writer.removeprefix("python -m studies page ")
            assert name in PAGES or (str(page.relative_to(DOCS)), name) in known, (page, mark)
            assert name in PAGES or mark == "machine" or mark.split()[0] == name, (page, mark)


def test_an_unknown_benchmark_or_case_is_named() -> None:
    with pytest.raises(DigsError, match="did you mean 'raster'"):
        find_benchmark("rastr")
    with pytest.raises(DigsError, match="no case 'mug'; it has ycb_mustard_bottle"):
        find_benchmark("surface").run(["mug"])


def test_make_pages_writes_all_pages() -> None:
    recipe = (DOCS.parent / "Makefile").read_text(encoding="utf-8")
    recipe = recipe.split("\npages:")[1].split("studies page ")[1].split("\n\n")[0]
    every = {each.name for each in BENCHMARKS} | set(PAGES)
    assert {*recipe.replace("\\", "").split()} == every - {"studies"}
