"""JSON of any shape, dataclasses, durations: right types and ranges, or an error that names file and key."""

import json
from dataclasses import dataclass, field
from math import isnan, nan
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.record.durations import seconds_of
from digs_warp.record.fields import ABOVE_ZERO, Fields, parse_json
from digs_warp.record.typed import NOT_STORED, Expect, from_json, to_json

VALUES: dict[str, Any] = {
    "whole": 7,
    "round": 7.0,
    "part": 7.5,
    "true": True,
    "text": "a",
    "null": None,
    "infinite": float("inf"),
    "nan": float("nan"),
    "huge": 10**400,
    "matrix": [[1, 2], [3, 4]],
    "ragged": [[1, 2], [3]],
    "words": ["a"],
    "odd": "a\0b",
    "half": "\ud800",
    "object": {"a": 1},
    "list": [{"a": 1}, {}],
    "deep": [[[[[[["x" * 500]]]]]]],
}
FIELDS = Fields(VALUES, "file 'x'", CaptureError)


def test_text_that_python_cannot_hold_is_one_kind_of_error() -> None:
    deep = ("[" * 100_000, '{"a":' * 100_000)
    for text in (*deep, "1" * 400, "1" * 5000, '{"w": -' + "9" * 5000 + "}", "[1,"):
        with pytest.raises(ValueError, match=r"nested|digits|Expecting"):
            parse_json(text)


def test_values_that_fit_are_returned() -> None:
    assert FIELDS.whole("whole", 7, 7) == FIELDS.whole("round") == 7
    assert FIELDS.number("part", 7.5, 7.5) == FIELDS.number("part", ABOVE_ZERO) == 7.5
    assert FIELDS.flag("true") is True
    assert FIELDS.text("text") == "a"
    assert FIELDS.section("object").number("a") == 1.0
    assert [len(each.values) for each in FIELDS.sections("list")] == [1, 0]
    np.testing.assert_array_equal(FIELDS.array("matrix", (-1,)), [1, 2, 3, 4])
    assert "whole" in FIELDS
    assert "null" not in FIELDS


def test_what_is_missing_or_null_takes_the_default() -> None:
    assert FIELDS.number("none", default=None) is None
    assert FIELDS.whole("null", default=3) == 3
    assert FIELDS.section("none", optional=True).text("x", "y") == "y"
    assert Fields({"a": 1}, "x", shared={"b": 2}).whole("b") == 2
    with pytest.raises(CaptureError, match="file 'x': has no 'none'"):
        FIELDS.number("none")


def test_what_is_of_another_type_or_out_of_range_is_refused() -> None:
    for name in ("part", "true", "text", "infinite", "nan", "huge", "list"):
        with pytest.raises(CaptureError, match=f"file 'x': {name} is .*, expected a whole number"):
            FIELDS.whole(name)
    for name in ("true", "text", "infinite", "nan", "huge", "object"):
        with pytest.raises(CaptureError, match=f"file 'x': {name} is .*, expected a finite number"):
            FIELDS.number(name)
    for name in ("ragged", "words", "text", "whole", "deep"):
        with pytest.raises(CaptureError, match=f"{name} is .{{,200}}, expected 2 x 2 finite num"):
            FIELDS.array(name, (2, 2))
    for wrong in (
        lambda: FIELDS.whole("whole", 8),
        lambda: FIELDS.number("part", 0, 7),
        lambda: FIELDS.text("odd"),
        lambda: FIELDS.text("half"),
        lambda: FIELDS.flag("whole"),
        lambda: FIELDS.section("list"),
        lambda: FIELDS.sections("object"),
        lambda: FIELDS.sections("words"),
        lambda: Fields.of([], "file 'x'", CaptureError),
    ):
        with pytest.raises(DigsError, match="file 'x'"):
            wrong()


def test_durations_are_read_and_others_refused() -> None:
    for text, seconds in [
        *(("90", 90.0), ("90s", 90.0), ("0.5s", 0.5)),
        *(("10m", 600.0), ("20min", 1200.0), ("1.5 min", 90.0), ("2h", 7200.0)),
    ]:
        assert seconds_of(text) == seconds
    for text in ("0", "0s", "-5s", "fast", "5 days", "1e3s", "min", "5minutes"):
        with pytest.raises(DigsError, match=r"such as 60s, 20min or 2h"):
            seconds_of(text)


@dataclass(frozen=True)
class Lens:
    focal: Annotated[float, Expect("a number above 0", lambda value: value > 0)]
    name: str = "wide"


@dataclass(frozen=True, kw_only=True)
class Shot:
    count: Annotated[int, Expect("a whole number, 1 or more", lambda value: value >= 1)]
    loss: float | None
    psnr: float = nan
    path: Path | None = None
    kind: Literal["a", "b"] = "a"
    good: bool = True
    rate: float | None = 30.0
    lens: Lens | None = None
    lenses: tuple[Lens, ...] = ()
    size: tuple[int, int] = (1, 2)
    sources: dict[str, int] = field(default_factory=dict)
    labels: dict[int, str] = field(default_factory=dict)
    limit: float | Literal["auto"] = "auto"
    figures: dict[str, Any] = field(default_factory=dict)
    images: Annotated[list[int], NOT_STORED] = field(default_factory=list)
    DERIVED: ClassVar = ("because",)

    @property
    def because(self) -> str:
        return f"{self.count} were seen"


FULL = Shot(
    count=3,
    loss=None,
    psnr=20.5,
    path=Path("a/b"),
    kind="b",
    good=False,
    rate=None,
    lens=Lens(2.0),
    lenses=(Lens(1.0, "x"), Lens(3.0)),
    size=(4, 5),
    sources={"depth": 7},
    labels={0: "ok"},
    limit=0.5,
    figures={"any": [1, {"x": None}]},
    images=[1],
)


def test_what_was_written_is_read() -> None:
    values = json.loads(json.dumps(to_json(FULL)))
    assert values["because"] == "3 were seen"
    assert values["loss"] is values["rate"] is None
    assert "images" not in values
    assert from_json(Shot, values, "x", images=[1]) == FULL


def test_defaults_are_kept_and_nan_is_null() -> None:
    values = to_json(Shot(count=1, loss=1.0))
    assert values["psnr"] is None
    assert "path" not in values
    found = from_json(Shot, values | {"more": 1, "good": None}, "x")
    assert isnan(found.psnr)
    assert found.good
    assert isinstance(from_json(Lens, {"focal": 2}, "x").focal, float)


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"count": 0}, "count is 0, expected a whole number, 1 or more"),
    ({"count": 1.5}, "count is 1.5, expected a whole number"),
    ({"count": True}, "count is True, expected a whole number"),
    ({"count": None}, "has no 'count'"),
    ({"psnr": 10**400}, "psnr is 1.*0, expected a finite number"),
    ({"psnr": "x" * 500}, "psnr is .{0,80}, expected a finite number"),
    ({"path": "a\0"}, "path is .*, expected a path"),
    ({"kind": "c"}, "kind is 'c', expected one of a, b"),
    ({"good": 1}, "good is 1, expected true or false"),
    ({"lens": []}, "file, lens: expected a JSON object"),
    ({"lens": {"name": "a"}}, "file, lens: has no 'focal'"),
    ({"lens": {"focal": 0}}, "file, lens: focal is 0, expected a number above 0"),
    ({"lenses": [{"focal": 1}, 3]}, "file, lenses 1: expected a JSON object"),
    ({"lenses": 3}, "lenses is 3, expected a list"),
    ({"size": [1]}, "size is .*, expected a list of 2"),
    ({"size": [1, "a"]}, "size 1 is 'a', expected a whole number"),
    ({"sources": {"depth": "many"}}, "file, sources: depth is 'many', expected a whole number"),
    ({"labels": {"x": "ok"}}, "labels is .*, expected a JSON object"),
    ({"limit": "never"}, "limit is 'never', expected a finite number or one of auto"),
]


def test_what_does_not_fit_is_named() -> None:
    for change, message in WRONG:
        with pytest.raises(CaptureError, match=f"{message}.*; run again"):
            values = to_json(FULL) | change
            from_json(Shot, values, "file", error=CaptureError, remedy="run again", images=[])


def test_settings_refuse_what_they_do_not_know() -> None:
    with pytest.raises(DigsError, match="settings: unknown setting 'focl'; did you mean 'focal'"):
        from_json(Lens, {"focl": 1}, "settings", strict=True)
    with pytest.raises(DigsError, match="settings: name is None, expected a text"):
        from_json(Lens, {"focal": 1, "name": None}, "settings", strict=True)
