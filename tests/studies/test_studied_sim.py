"""The benchmark of the simulated sensor: every tier and effect is told."""

import pytest

from studies.results import Result
from studies.simulator import COLUMNS, TIERS, bench_sim


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
