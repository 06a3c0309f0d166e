"""What a benchmark measured: one result per case, shown as tables, stored as JSON lines.

A line has the shape of a line of a study's results.jsonl: labels that name the case, then what was measured.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from digs_warp.record.files import write_atomically
from digs_warp.study.table import Table


@dataclass(frozen=True)
class Result:
    """The numbers of one case.

    Attributes:
        labels: what tells the case from the others, for example ``{"splats": 100000, "threads": 2}``.
        values: what was measured, by name and unit: ``{"forward [ms]": 12.5}``.
        table: the table that the case belongs to, where a benchmark has several.
    """

    labels: Mapping[str, Any]
    values: Mapping[str, float]
    table: str = ""


def tables(results: Sequence[Result]) -> list[Table]:
    """Return one table per table name and set of labels: a row per case, a column per value."""
    groups: dict[tuple[str, tuple[str, ...]], list[Result]] = {}
    for result in results:
        groups.setdefault((result.table, tuple(result.labels)), []).append(result)
    return [_table(name, keys, group) for (name, keys), group in groups.items()]


def _table(name: str, keys: Sequence[str], results: Sequence[Result]) -> Table:
    """Return the table; labels that all cases share become its caption."""
    varying = [
        key
        for key in keys
        if len(results) == 1 or len({repr(result.labels[key]) for result in results}) > 1
    ]
    columns = list(dict.fromkeys(name for result in results for name in result.values))
    rows = [
        [
            *(str(result.labels[key]) for key in varying),
            *(format_number(result.values[c]) if c in result.values else "" for c in columns),
        ]
        for result in results
    ]
    shared = [f"{key}: {results[0].labels[key]}" for key in keys if key not in varying]
    return Table(name, [*varying, *columns], rows, caption=", ".join(shared))


def format_tables(results: Sequence[Result]) -> str:
    """Return the tables as aligned text."""
    return "\n\n".join(table.text() for table in tables(results)) or "no results"


def format_number(value: float) -> str:
    """Return a count in full, else four significant digits; no exponent below a million."""
    if isinstance(value, int):
        return f"{value:,}"
    if value == 0 or not 1e-4 <= abs(value) < 1e6:
        return f"{value:.4g}"
    decimals = max(0, 4 - len(str(int(abs(value)))))
    return f"{value:,.{decimals}f}"


def write_json_lines(results: Sequence[Result], path: Path) -> None:
    """Write one JSON object per line: labels, values, table."""
    lines = [json.dumps(asdict(result), allow_nan=False) + "\n" for result in results]
    write_atomically(path, "".join(lines).encode())
