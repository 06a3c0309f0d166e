"""The report of a study: Markdown with tables and pictures, CSV files, and one self-contained HTML page."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from digs_warp.record.files import write_atomically
from digs_warp.show.report import markup
from digs_warp.show.report.markup import CSS
from digs_warp.study.charts import Chart
from digs_warp.study.table import Table

MARKDOWN = "report.md"
PAGE = "report.html"


@dataclass(frozen=True)
class Section:
    """One finding: what it says, with its tables and charts."""

    title: str
    text: str
    tables: Sequence[Table] = ()
    charts: Sequence[Chart] = ()


def write_pages(title: str, intro: str, sections: Sequence[Section], folder: Path) -> Path:
    """Write report.md, report.html, tables/ and plots/ into ``folder``; return the HTML page."""
    folder = Path(folder)
    for section in sections:
        for table in section.tables:
            write_atomically(folder / "tables" / f"{table.name}.csv", table.csv())
        for chart in section.charts:
            write_atomically(folder / "plots" / f"{chart.name}.png", chart.png())
    write_atomically(folder / MARKDOWN, _markdown(title, intro, sections).encode())
    write_atomically(folder / PAGE, html_page(title, intro, sections).encode())
    return folder / PAGE


def _markdown(title: str, intro: str, sections: Sequence[Section]) -> str:
    parts = [f"# {title}", intro]
    for section in sections:
        parts += [f"## {section.title}", section.text]
        parts += [f"![{chart.title}](plots/{chart.name}.png)" for chart in section.charts]
        parts += [table.markdown() for table in section.tables]
    return "\n\n".join(parts) + "\n"


def html_page(title: str, intro: str, sections: Sequence[Section]) -> str:
    """Return the self-contained page."""
    body = "\n".join(map(_html_section, sections))
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n<main>\n"
        f"<header><h1>{escape(title)}</h1><p>{escape(intro)}</p></header>\n{body}\n"
        "</main>\n</body>\n</html>\n"
    )


def _html_section(section: Section) -> str:
    charts = ""
    for chart in section.charts:
        uri = "data:image/png;base64," + base64.b64encode(chart.png()).decode()
        picture = f'<img src="{uri}" alt="{escape(chart.title)}">'
        charts += markup.figure(picture, chart.title)
    tables = "".join(markup.table(table.headings, table.rows) for table in section.tables)
    return markup.section(section.title, section.text, f"<div class=charts>{charts}</div>", tables)
