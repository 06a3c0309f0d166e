"""Small pieces of HTML. Every function takes plain text and escapes it; only ``body`` arguments are HTML."""

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from digs_warp.show.report.pictures import ColorScale

UNKNOWN = "–"  # noqa: RUF001 (a dash, not a minus)


def section(title: str, intro: str, *body: str) -> str:
    """Return a titled section with an introductory sentence."""
    return f"<section><h2>{escape(title)}</h2><p>{escape(intro)}</p>{''.join(body)}</section>"


def card(label: str, value: str, note: str = "") -> str:
    """Return one key number."""
    note = f"<small>{escape(note)}</small>" if note else ""
    return f"<div class=card><span>{escape(label)}</span><b>{escape(value)}</b>{note}</div>"


def picture(uri: str, alt: str, width: int, height: int) -> str:
    """Return an image of known size."""
    return (
        f'<img src="{escape(uri)}" alt="{escape(alt)}" '
        f'width="{width}" height="{height}" loading="lazy">'
    )


def figure(body: str, caption: str) -> str:
    """Return a figure with a caption; ``body`` is HTML."""
    return f"<figure>{body}<figcaption>{escape(caption)}</figcaption></figure>"


def chart(svg: str, alt: str, caption: str) -> str:
    """Return a figure around an inline SVG."""
    return figure(f'<div class=chart role=img aria-label="{escape(alt)}">{svg}</div>', caption)


def picture_grid(headings: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Return a table of pictures: a label and one cell of HTML per heading in each row."""
    head = "".join(f"<th scope=col>{escape(heading)}</th>" for heading in ["", *headings])
    body = "".join(
        f"<tr><th scope=row>{escape(label)}</th>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"
        for label, cells in rows
    )
    return (
        f'<div class=scroll><table class=pictures style="--columns:{len(headings)}">'
        f"<tr>{head}</tr>{body}</table></div>"
    )


def table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table of text: the first column are labels, the others values."""
    head = "".join(f"<th scope=col>{escape(heading)}</th>" for heading in headings)
    body = "".join(
        f"<tr><th scope=row>{escape(str(row[0]))}</th>"
        + "".join(f"<td>{escape(str(value))}</td>" for value in row[1:])
        + "</tr>"
        for row in rows
    )
    return f"<div class=scroll><table class=values><tr>{head}</tr>{body}</table></div>"


def details(summary: str, body: str) -> str:
    """Return a part that opens on click; ``body`` is HTML."""
    return f"<details><summary>{escape(summary)}</summary>{body}</details>"


def legend(scale: ColorScale, missing: bool = False) -> str:
    """Return the color bar of a scale with its ticks; ``missing``: explain the gray, too."""
    gradient = ", ".join(scale.gradient())
    decimals = 2 if scale.high - scale.low < 10 else 0
    ticks = "".join(f"<span>{tick:.{decimals}f}</span>" for tick in scale.ticks())
    gray = "<span><i class=missing></i>no value</span>" if missing else ""
    return (
        f"<div class=legend><span>{escape(scale.label)}</span><div>"
        f'<div class=ramp style="background:linear-gradient(to right, {gradient})"></div>'
        f"<div class=ticks>{ticks}</div></div>{gray}</div>"
    )


def swatches(items: Iterable[tuple[str, str]]) -> str:
    """Return a legend of (data URI of a small picture, text) pairs."""
    parts = (f'<span><img src="{escape(uri)}" alt="">{escape(text)}</span>' for uri, text in items)
    return f"<div class=swatches>{''.join(parts)}</div>"


def number(value: float | None, decimals: int, unit: str = "") -> str:
    """Return a number as text, a dash for None and NaN: it is not known."""
    if value is None or math.isnan(value):
        return UNKNOWN
    return f"{value:,.{decimals}f}{' ' + unit if unit else ''}"


def flat_items(value: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Return nested settings as (dotted name, value) pairs."""
    pairs: list[tuple[str, str]] = []
    for key, entry in value.items():
        if isinstance(entry, Mapping):
            pairs += flat_items(entry, f"{prefix}{key}.")
        else:
            pairs.append((f"{prefix}{key}", UNKNOWN if entry is None else str(entry)))
    return pairs
