"""The curve of an error at rising noise, and its checks."""

import math

import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.testing.curve import DegradationCurve


def test_growth_is_the_slope_between_logarithms() -> None:
    curve = DegradationCurve((0, 1, 2, 8), (0.0, 3.0, 12.0, 12.0))
    assert curve.growth() == [(1, 2, pytest.approx(2.0)), (2, 8, 0.0)]


def test_a_cliff_is_found_and_shown() -> None:
    curve = DegradationCurve((0, 1, 2, 4), (0.001, 0.01, 0.02, 0.64))
    curve.assert_no_cliff(largest_growth=5.0)
    with pytest.raises(AssertionError) as caught:
        curve.assert_no_cliff()
    message = str(caught.value)
    assert "from strength 2 to 4 it grows with exponent 5.00 (limit 2)" in message
    assert "       4         0.64 " + "#" * 40 in message


def test_an_error_that_starts_from_nothing_is_a_cliff() -> None:
    with pytest.raises(AssertionError, match="exponent inf"):
        DegradationCurve((1, 2), (0.0, 0.1)).assert_no_cliff()
    DegradationCurve((1, 2), (0.0, 0.0)).assert_no_cliff()


def test_an_error_that_appears_with_the_first_noise_and_stays_is_a_cliff() -> None:
    jump = DegradationCurve((0, 1, 2, 4), (0.001, 10.0, 10.1, 10.2))
    with pytest.raises(AssertionError, match=r"jumps from strength 0 to 1; .* exponent 0\.01"):
        jump.assert_no_cliff()
    jump.assert_no_cliff(smallest_growth=0)
    with pytest.raises(AssertionError, match="jumps from strength 0"):
        DegradationCurve((0, 1, 2), (0.0, 1.0, 1.0)).assert_no_cliff()
    DegradationCurve(
        (0, 1, 4), (0.0, 1.0, 2.0)
    ).assert_no_cliff()  # a square root is slow, but grows
    DegradationCurve((0, 1, 4), (1.0, 1.1, 1.1)).assert_no_cliff()  # hardly touched by noise


def test_an_error_that_falls_with_rising_noise_is_refused() -> None:
    falls = ((0.0, 1.0, 2.0, 0.1), (4.0, 1.0, 1.5, 3.0), (1.0, 0.9, 0.6, 0.4))
    for errors in (*falls, (0.001, 0.01, 0.002, 0.02)):  # the last one comes back steeply
        with pytest.raises(AssertionError, match="falls while the noise rises"):
            DegradationCurve((0, 1, 2, 4), errors).assert_no_cliff()
    DegradationCurve((0, 1, 2, 4), (1.0, 0.9, 1.1, 0.8)).assert_no_cliff()  # by chance


def test_a_curve_without_growth_or_numbers_proves_nothing() -> None:
    for strengths in ((0,), (0, 1), (1,)):
        with pytest.raises(DigsError, match="expected two above 0"):
            DegradationCurve(strengths, tuple(range(len(strengths)))).assert_no_cliff()
    for broken in (math.nan, math.inf):
        curve = DegradationCurve((0, 1, 2), (0.0, broken, 0.1))
        with pytest.raises(AssertionError, match="no numbers"):
            curve.assert_no_cliff()
        with pytest.raises(AssertionError, match="is no number at noise strength 1 "):
            curve.assert_at_most({1: 5.0})


def test_limits_hold_at_the_strengths_they_name() -> None:
    curve = DegradationCurve((0, 1, 2), (0.0, 0.1, 0.5))
    curve.assert_at_most({0: 0.0, 1: 0.1})
    with pytest.raises(AssertionError, match=r"at noise strength 2 \(limit 0.4\)"):
        curve.assert_at_most({1: 0.1, 2: 0.4})
    with pytest.raises(DigsError, match="strength 3 was not measured, expected some of"):
        curve.assert_at_most({3: 1.0})
