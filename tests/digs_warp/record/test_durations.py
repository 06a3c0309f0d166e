"""Durations of the command line."""

import pytest

from digs_warp.checks import DigsError
from digs_warp.record.durations import seconds_of


def test_durations_are_read_and_others_refused() -> None:
    for text, seconds in [
        *(("90", 90.0), ("90s", 90.0), ("0.5s", 0.5)),
        *(("10m", 600.0), ("20min", 1200.0), ("1.5 min", 90.0), ("2h", 7200.0)),
    ]:
        assert seconds_of(text) == seconds
    for text in ("0", "0s", "-5s", "fast", "5 days", "1e3s", "min", "5minutes"):
        with pytest.raises(DigsError, match=r"such as 60s, 20min or 2h"):
            seconds_of(text)
