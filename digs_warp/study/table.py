"""A table of text, as Markdown, as CSV, and for a terminal."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """Rows of text under headings; the first column labels the row.

    Attributes:
        name: of its CSV file, without suffix, or of its place in a page.
        headings: of the columns.
        rows: as many cells as headings in each.
        caption: what all rows have in common; shown above the table.
    """

    name: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""

    def csv(self) -> bytes:
        """Return the table as CSV."""
        file = io.StringIO()
        csv.writer(file, lineterminator="\n").writerows([self.headings, *self.rows])
        return file.getvalue().encode()

    def markdown(self) -> str:
        """Return the table as Markdown."""
        lines = [list(self.headings), ["---"] * len(self.headings), *self.rows]
        table = "\n".join("| " + " | ".join(map(_cell, line)) + " |" for line in lines)
        return f"{self.caption}\n\n{table}" if self.caption else table

    def text(self) -> str:
        """Return the table as aligned columns for a terminal; numbers end flush."""
        columns = [
            _aligned(cells) for cells in zip(self.headings, *map(tuple, self.rows), strict=True)
        ]
        lines = ["  ".join(cells).rstrip() for cells in zip(*columns, strict=True)]
        lines.insert(1, "  ".join("-" * len(column[0]) for column in columns))
        return "\n".join([self.caption, "", *lines] if self.caption else lines)


def _aligned(cells: Sequence[str]) -> list[str]:
    """Return a heading and its cells padded to one width: numbers to the right, words to the left."""
    width = max(map(len, cells))
    if all(cell.lstrip("+-")[:1].isdigit() for cell in cells[1:] if cell):
        return [cell.rjust(width) for cell in cells]
    return [cell.ljust(width) for cell in cells]


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
