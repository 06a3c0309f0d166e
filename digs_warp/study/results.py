"""Results of a benchmark or a study: one number each; as a table for people, as JSON lines for programs."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from digs_warp.record.files import write_atomically


@dataclass(frozen=True)
class Result:
    """One measured number and everything needed to measure it again.

    Attributes:
        name: what was measured, for example "forward".
        value: the number.
        unit: its unit, for example "ms".
        settings: what it depends on, for example ``{"splats": 100000, "threads": 2}``.
    """

    name: str
    value: float
    unit: str
    settings: dict[str, Any] = field(default_factory=dict)


def format_table(results: Sequence[Result]) -> str:
    """Return the results as aligned columns; settings that all of them share stand above, once."""
    if not results:
        return "no results"
    keys = list(dict.fromkeys(key for result in results for key in result.settings))
    shared = [key for key in keys if len({repr(r.settings.get(key)) for r in results}) == 1]
    varying = [key for key in keys if key not in shared]
    rows = [["name", *varying, "value", "unit"]]
    for r in results:
        cells = [str(r.settings.get(key, "")) for key in varying]
        rows.append([r.name, *cells, format_number(r.value), r.unit])
    lines = _aligned(rows, {len(rows[0]) - 2})  # the column of values
    if shared:
        lines.insert(
            0, ", ".join(f"{key}: {results[0].settings.get(key)}" for key in shared) + "\n"
        )
    return "\n".join(lines)


def format_wide_table(results: Sequence[Result]) -> str:
    """Return one row per settings and one column per name: for many numbers of the same cases.

    Settings that were measured for other names stand in a table of their own.
    """
    cases: dict[tuple[tuple[str, Any], ...], dict[str, float]] = {}
    for result in results:
        cases.setdefault(tuple(result.settings.items()), {})[result.name] = result.value
    tables: dict[tuple[tuple[str, ...], tuple[str, ...]], list[list[str]]] = {}
    for settings, values in cases.items():
        keys, names = tuple(key for key, _ in settings), tuple(values)
        rows = tables.setdefault((keys, names), [[*keys, *names]])
        cells = [str(value) for _, value in settings]
        rows.append([*cells, *map(format_number, values.values())])
    texts = [
        "\n".join(_aligned(rows, set(range(len(keys), len(rows[0])))))
        for (keys, _), rows in tables.items()
    ]
    return "\n\n".join(texts) or "no results"


def _aligned(rows: list[list[str]], right: set[int]) -> list[str]:
    """Return lines of aligned cells with a rule under the first; columns in ``right`` end flush."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "  ".join(
            cell.rjust(width) if column in right else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    lines.insert(1, "  ".join("-" * width for width in widths))
    return lines


def format_number(value: float) -> str:
    """Return ``value`` with four significant digits, never in exponent form below a million."""
    if value == 0 or not 1e-4 <= abs(value) < 1e6:
        return f"{value:.4g}"
    decimals = max(0, 4 - len(str(int(abs(value)))))
    return f"{value:,.{decimals}f}"


def write_json_lines(results: Sequence[Result], path: Path) -> None:
    """Write one JSON object per line: name, value, unit, settings."""
    lines = [json.dumps(asdict(result), allow_nan=False) + "\n" for result in results]
    write_atomically(path, "".join(lines).encode())
