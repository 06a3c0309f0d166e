"""JSON of any shape: values of the right type and range, or an error that names the file and the key."""

from typing import Any

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.record.fields import ABOVE_ZERO, Fields, parse_json

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
    assert FIELDS.whole("whole", 0, 10) == FIELDS.whole("round") == 7
    assert FIELDS.number("part", ABOVE_ZERO) == 7.5
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
