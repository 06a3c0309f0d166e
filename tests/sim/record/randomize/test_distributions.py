"""Distributions give what their names say: against SciPy's, and by counts."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from scipy import stats

from digs_warp.sim.record.randomize.distributions import (
    Choice,
    Distribution,
    Normal,
    Span,
)
from digs_warp.sim.record.randomize.draws import share_of

SCENES = 4000


def draws(distribution: Distribution, key: str = "light_level") -> list[Any]:
    return [distribution.at(share_of(3, scene, key)) for scene in range(SCENES)]


@pytest.mark.parametrize(
    ("distribution", "twin"),
    [
        (Span(-2.0, 3.0), stats.uniform(-2, 5)),
        (Span(0.25, 8.0, "log_uniform"), stats.loguniform(0.25, 8)),
        (Normal(1.0, 0.5, 0.2, 1.5), stats.truncnorm(-1.6, 1.0, 1.0, 0.5)),
        (Normal(0.0, 1.0, 4.0, 6.0), stats.truncnorm(4, 6)),
        (Normal(0.0, 1.0, -9.0, -7.5), stats.truncnorm(-9, -7.5)),
    ],
)
def test_numbers_follow_the_distribution(distribution: Distribution, twin: Any) -> None:
    shares = np.linspace(0, 1, 200, endpoint=False)
    found: Any = [distribution.at(share) for share in shares]
    np.testing.assert_allclose(found, twin.ppf(shares), rtol=1e-6, atol=1e-9)
    # And with the shares that scenes have: a spread 1.1 times as wide is noticed.
    values = np.array(draws(distribution))
    assert stats.kstest(values, twin.cdf).pvalue > 1e-3
    assert values.std() == pytest.approx(twin.std(), rel=0.05)
    assert values.mean() == pytest.approx(twin.mean(), abs=0.05 * twin.std())


@pytest.mark.parametrize(
    "distribution", [Span(1.0, 2.0), Span(1.0, 2.0, "log_uniform"), Normal(0.0, 3.0, 1.0, 2.0)]
)
def test_no_number_lies_outside_the_limits(distribution: Distribution) -> None:
    for share in (0.0, 1e-300, 0.5, 1 - 2**-53):
        assert 1.0 <= distribution.at(share) <= 2.0  # pyright: ignore[reportOperatorIssue]


def test_whole_numbers_include_both_ends_evenly() -> None:
    counts = Counter(draws(Span(2, 5)))
    assert sorted(counts) == [2, 3, 4, 5]
    assert [counts[n] / SCENES for n in (2, 3, 4, 5)] == pytest.approx([0.25] * 4, abs=0.025)
    assert Span(2, 5).at(1 - 2**-53) == 5


def test_choices_come_as_often_as_their_weights_say() -> None:
    counts = Counter(draws(Choice(("a", "b", None), (1.0, 4.0, 5.0))))
    shares = [counts[value] / SCENES for value in ("a", "b", None)]
    assert shares == pytest.approx([0.1, 0.4, 0.5], abs=0.025)
    even = Counter(draws(Choice.even(True, False)))
    assert even[True] / SCENES == pytest.approx(0.5, abs=0.025)
    assert Choice(("a", "b"), (0.1, 0.2)).at(1 - 2**-53) == "b"


def test_a_fixed_value_stays() -> None:
    assert set(draws(Choice.even("d435"))) == {"d435"}


@pytest.mark.parametrize(
    ("distribution", "words"),
    [
        (Choice.even(None), "null"),
        (Span(0.0, 360.0), "{uniform: [0, 360]}"),
        (Span(0.5, 2.0, "log_uniform"), "{log_uniform: [0.5, 2]}"),
        (Normal(0.0, 0.5, -1.0, 1.0), "{normal: [0, 0.5], limits: [-1, 1]}"),
        (Choice(("d435", (1.0, 2.0)), (2.0, 1.0)), "{choice: [d435, [1, 2]], weights: [2, 1]}"),
    ],
)
def test_words_are_those_of_the_file(distribution: Distribution, words: str) -> None:
    assert distribution.words == words
