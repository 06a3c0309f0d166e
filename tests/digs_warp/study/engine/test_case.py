"""Cases and their settings."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.engines.task import RESULTS
from digs_warp.study.engine.case import Case, with_settings

DOCS = Path(__file__).parents[4] / "docs"


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


def test_settings_change_by_dotted_names_and_are_checked_together() -> None:
    changed = with_settings(Outer(), {"inner.high": 7, "name": "y"})
    assert changed == Outer(Inner(1, 7), "y")
    # One after the other, low = 5 would be refused.
    assert with_settings(Outer(), {"inner.low": 5, "inner.high": 9}).inner == Inner(5, 9)
    with pytest.raises(DigsError, match="low above high"):
        with_settings(Outer(), {"inner.low": 5})
    for name in ("nothing", "inner.nothing", "nothing.low"):
        with pytest.raises(DigsError, match="unknown setting 'nothing'"):
            with_settings(Outer(), {name: 1})


def test_the_key_follows_the_content_and_neither_the_order_nor_where_files_lie() -> None:
    first = Case({"a": 1, "b": 2}, {"frames": 3})
    assert first.key == Case({"b": 2, "a": 1}, {"frames": 3}).key
    assert first.key != Case({"a": 1, "b": 2}, {"frames": 4}).key
    assert first.recording_key == Case({}, {"frames": 3}, {"test_every": 4}).recording_key
    here, there = (Case({}, {"mesh": f"{folder}/mug.glb", "environment": None}) for folder in "ab")
    assert here.key == there.key != Case({}, {"mesh": "a/cup.glb", "environment": None}).key
    assert here.recording_key != there.recording_key  # recordings are made from the files


def test_a_published_study_can_be_continued() -> None:
    for line in (DOCS / "study/tradeoff" / RESULTS).read_text(encoding="utf-8").splitlines():
        record = json.loads(line)
        settings = (record[name] for name in ("labels", "recording", "reconstruction"))
        assert Case(*settings).key == record["key"]
