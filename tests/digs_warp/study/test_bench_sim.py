"""The benchmark of the simulated sensor: every tier, cause and effect is told, and table and plot show it."""

from pathlib import Path

import pytest

from digs_warp.study.bench_sim import COLUMNS, TIERS, bench_sim, sim_charts
from digs_warp.study.charts import side_by_side
from digs_warp.study.results import Result, format_tables


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> list[Result]:
    """Without sample data: the built-in object, small."""
    return bench_sim(tmp_path_factory.mktemp("nothing"), width=160, recordings=())


def test_every_tier_has_a_time_and_all_scores(results: list[Result]) -> None:
    tiers = {r.labels["sensor"]: r.values for r in results if "sensor" in r.labels}
    assert set(tiers) == set(TIERS)
    for told in tiers.values():
        assert set(told) == {"time [ms/MP]", "CPU [ms/MP]", *COLUMNS.values()}
        assert told["time [ms/MP]"] > 0 and told["CPU [ms/MP]"] > 0
    truth = tiers["truth"]
    assert (truth["fill"], truth["bad-1"], truth["rms [px]"]) == (1, 0, 0)


def test_effects_are_told_with_what_they_change(results: list[Result]) -> None:
    effects = {r.labels["effect"]: r.values for r in results if "effect" in r.labels}
    assert {"static-field", "quantum"} <= set(effects)
    assert effects["static-field"]["changes rms [px]"] > 0.005
    assert effects["quantum"]["changes fill"] == 0


def test_a_plan_is_told_with_its_price(results: list[Result]) -> None:
    (told,) = (r.values for r in results if r.table == "plans")
    assert told["planning [s]"] > 0 and told["frame as planned [ms/MP]"] > 0
    assert told["metering [s]"] >= 0 and told["frames that pay for planning"] >= 0


def test_causes_are_told_for_both_searches(results: list[Result]) -> None:
    causes = {r.labels["cause"]: r.values for r in results if "cause" in r.labels}
    assert {"occluded", "band"} <= set(causes) and "ok" not in causes
    occluded = causes["occluded"]
    for tier in ("matcher", "guided"):
        assert 0 < occluded[f"{tier}: missing"] < 0.5 and 0 <= occluded[f"{tier}: wrong"] < 0.5


def test_the_wide_table_has_a_row_per_case_and_a_column_per_name(results: list[Result]) -> None:
    caption, *tables = format_tables(results).split("\n\n")
    assert caption == "scene: built-in" and len(tables) == 4  # tiers, plans, causes, effects
    header, _, *rows = tables[0].splitlines()
    assert header.split()[0] == "sensor" and len(rows) == len(TIERS)
    effects = {r.labels["effect"] for r in results if "effect" in r.labels}
    assert len(tables[3].splitlines()) == 2 + len(effects)


def test_the_plot_is_a_png(results: list[Result], tmp_path: Path) -> None:
    assert side_by_side(sim_charts(results)).startswith(b"\x89PNG\r\n")
