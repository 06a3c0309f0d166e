"""The benchmark of the simulated sensor: every tier and effect is told, and the table and plot show it."""

from pathlib import Path

import pytest

from digs_warp.study.bench_sim import COLUMNS, TIERS, bench_sim
from digs_warp.study.plot_sim import plot_sim
from digs_warp.study.results import Result, format_wide_table


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> list[Result]:
    """Without sample data: the built-in object, small."""
    return bench_sim(tmp_path_factory.mktemp("nothing"), width=160)


def test_every_tier_has_a_time_and_all_scores(results: list[Result]) -> None:
    tiers = {r.settings["sensor"] for r in results if "sensor" in r.settings}
    assert tiers == set(TIERS)
    for tier in TIERS:
        told = {r.name: r.value for r in results if r.settings.get("sensor") == tier}
        assert set(told) == {"time [ms/MP]", "CPU [ms/MP]", *COLUMNS.values()}
        assert told["time [ms/MP]"] > 0 and told["CPU [ms/MP]"] > 0
    truth = {r.name: r.value for r in results if r.settings.get("sensor") == "truth"}
    assert (truth["fill"], truth["bad-1"], truth["rms [px]"]) == (1, 0, 0)


def test_effects_are_told_with_what_they_change(results: list[Result]) -> None:
    effects = {r.settings["effect"] for r in results if "effect" in r.settings}
    assert {"occlusion", "correlated-noise", "invalid-band"} <= effects
    changes = {r.settings["effect"]: r.value for r in results if r.name == "changes fill"}
    assert changes["occlusion"] < 0 and changes["invalid-band"] < 0
    assert changes["correlated-noise"] == pytest.approx(0, abs=1e-3)


def test_causes_are_told_for_matcher_and_planned_tier(results: list[Result]) -> None:
    causes = {r.settings["cause"] for r in results if "cause" in r.settings}
    assert {"occluded", "band"} <= causes and "ok" not in causes
    occluded = {r.name: r.value for r in results if r.settings.get("cause") == "occluded"}
    for tier in ("matcher", "planned"):
        assert 0 < occluded[f"{tier}: missing"] < 0.5 and 0 <= occluded[f"{tier}: wrong"] < 0.5


def test_the_wide_table_has_a_row_per_case_and_a_column_per_name(results: list[Result]) -> None:
    tables = format_wide_table(results).split("\n\n")
    assert len(tables) == 3  # tiers, causes, effects
    header, _, *rows = tables[0].splitlines()
    assert header.split()[:2] == ["scene", "sensor"] and len(rows) == len(TIERS)
    effects = {r.settings["effect"] for r in results if "effect" in r.settings}
    assert len(tables[2].splitlines()) == 2 + len(effects)


def test_the_plot_is_a_png(results: list[Result], tmp_path: Path) -> None:
    assert plot_sim(results).startswith(b"\x89PNG\r\n")
