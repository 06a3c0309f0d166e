"""Cases and their settings."""

from dataclasses import dataclass, field

import pytest

from digs_warp.checks import DigsError
from digs_warp.study.engine.case import Case, with_settings


@dataclass(frozen=True)
class Inner:
    low: int = 1
    high: int = 2

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise DigsError("low above high")


@dataclass(frozen=True)
class Outer:
    inner: Inner = field(default_factory=Inner)
    name: str = "x"


def test_settings_change_by_dotted_names() -> None:
    changed = with_settings(Outer(), {"inner.high": 7, "name": "y"})
    assert changed == Outer(Inner(1, 7), "y")
    assert with_settings(Outer(), {}) == Outer()


def test_settings_of_one_record_are_checked_together() -> None:
    # One after the other, low = 5 would be refused.
    assert with_settings(Outer(), {"inner.low": 5, "inner.high": 9}).inner == Inner(5, 9)
    with pytest.raises(DigsError, match="low above high"):
        with_settings(Outer(), {"inner.low": 5})


@pytest.mark.parametrize("name", ["nothing", "inner.nothing", "nothing.low", "name.low"])
def test_an_unknown_setting_is_an_error(name: str) -> None:
    with pytest.raises(DigsError, match=r"no setting|is a value"):
        with_settings(Outer(), {name: 1})


def test_the_key_follows_the_content_and_not_the_order() -> None:
    first = Case({"a": 1, "b": 2}, {"frames": 3})
    assert first.key == Case({"b": 2, "a": 1}, {"frames": 3}).key
    assert first.key != Case({"a": 1, "b": 2}, {"frames": 4}).key
    assert first.recording_key == Case({}, {"frames": 3}, {"test_every": 4}).recording_key
