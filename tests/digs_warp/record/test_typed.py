"""Dataclasses to JSON and back: what was written is read, and what does not fit is named."""

import json
from dataclasses import dataclass, field
from math import isnan, nan
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.record.typed import NOT_STORED, Expect, from_json, to_json


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
