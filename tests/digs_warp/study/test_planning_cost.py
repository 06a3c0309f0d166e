"""When planning has paid for itself, and how two kinds of frame are timed."""

import math

from digs_warp.study.planning_cost import cpu_in_turns, frames_that_pay


def test_planning_pays_after_what_it_took_over_what_a_frame_saves() -> None:
    assert frames_that_pay(spent=0.2, saved=0.01) == 20
    assert frames_that_pay(spent=-0.1, saved=0.01) == 0, "it switched off more than it took"
    assert frames_that_pay(spent=-0.1, saved=-0.01) == 0
    assert math.isinf(frames_that_pay(spent=0.2, saved=0.0))


def test_functions_take_turns_after_a_first_call_that_does_not_count() -> None:
    calls: list[str] = []
    times = cpu_in_turns([lambda: calls.append("a"), lambda: calls.append("b")], rounds=3)
    assert "".join(calls) == "ab" + 3 * "ab"
    assert [len(mine) for mine in times] == [3, 3] and min(map(min, times)) >= 0
