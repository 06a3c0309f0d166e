"""Small pieces of HTML. Every function takes plain text and escapes it; only ``body`` arguments are HTML.

The style sheet: light and dark, no outside fonts, readable on a phone and on paper.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from digs_warp.show.report.pictures import ColorScale

CSS = """
:root { color-scheme: light dark; --ink: #1d2430; --soft: #5d6b7e; --paper: #f6f7f9; --panel: #fff;
  --rule: #dfe4ea; --accent: #1f66b8; --stage: #fff; --good: #1b7f4b; --poor: #b3401e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6eaf0; --soft: #9aa7b8; --paper: #12161c;
  --panel: #1a2029; --rule: #2c3541; --accent: #6aaaf0; --stage: #12161c; --good: #5cc78e;
  --poor: #f0906e; } }
* { box-sizing: border-box; }
html { scroll-padding-top: 3.5rem; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Liberation Sans", sans-serif; }
main { max-width: 1320px; margin: 0 auto; padding: 1.25rem 1.25rem 4rem; }
h1 { font-size: 1.6rem; margin: 0; letter-spacing: -0.01em; }
h2 { font-size: 1.25rem; margin: 0 0 .25rem; }
h3 { font-size: 1rem; margin: 1.25rem 0 .5rem; }
p { margin: .25rem 0 1rem; color: var(--soft); max-width: 75ch; }
header p { margin: 0; max-width: none; }
.verdict { font-size: 1.1rem; color: var(--ink); }
.good { color: var(--good); } .poor { color: var(--poor); }
nav { position: sticky; top: 0; z-index: 2; display: flex; gap: .25rem 1.1rem; overflow-x: auto;
  scrollbar-width: none; white-space: nowrap; background: var(--paper); padding: .5rem 0; font-size: .9rem; }
section, details.part { background: var(--panel); border: 1px solid var(--rule); border-radius: 12px;
  padding: 1.25rem 1.5rem; margin-top: 1rem; }
details.part { padding: .75rem 1.5rem; }
details.part > summary { color: var(--ink); }
details.part > summary h2 { display: inline; font-size: 1.1rem; }
details.part > summary span { color: var(--soft); margin-left: .75rem; }
details.part[open] > summary { margin-bottom: .75rem; }
.cards { display: grid; gap: .75rem;
  grid-template-columns: repeat(4, 1fr); margin-top: 1rem; }
@media (max-width: 60rem) { .cards { grid-template-columns: repeat(2, 1fr); } }
.card { background: var(--panel); border: 1px solid var(--rule); border-radius: 12px;
  padding: .6rem 1rem; display: flex; flex-direction: column; }
.card a, .card small { color: var(--soft); font-size: .82rem; }
.card b { font-size: 1.45rem; font-variant-numeric: tabular-nums; white-space: nowrap; }
.card em { font-style: normal; font-size: .95rem; font-weight: 600; }
.cards + p { margin-top: .75rem; max-width: none; }
.scroll { overflow-x: auto; } .scroll + .charts { margin-top: 1.25rem; }
table { border-collapse: collapse; }
table.pictures { width: 100%; min-width: 40rem; table-layout: fixed; }
table.pictures th { font-size: .82rem; font-weight: 600; color: var(--soft); padding: .25rem;
  text-align: left; vertical-align: middle; overflow-wrap: anywhere; }
table.pictures tr > :first-child { width: 7.5rem; white-space: pre-line; }
table.pictures td { padding: .25rem; }
img { display: block; width: 100%; height: auto; border-radius: 4px; background: var(--rule);
  outline: 1px solid var(--rule); }
table.pictures img { cursor: zoom-in; }
dialog { border: 0; padding: 0; width: 100vw; height: 100vh; max-width: none; max-height: none;
  background: #111; color: #eee; }
dialog[open] { display: grid; grid-template-rows: 1fr auto; }
dialog img { width: 100%; height: 100%; min-height: 0; object-fit: contain; background: none; outline: 0;
  cursor: zoom-out; }
dialog p { margin: .5rem 1rem; color: #ccc; }
table.values { font-size: .9rem; font-variant-numeric: tabular-nums; }
table.values th, table.values td { padding: .25rem 1.5rem .25rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--rule); }
table.values td { overflow-wrap: break-word; }
table.values td:nth-child(2):last-child { overflow-wrap: anywhere; }
table.values:has(th:nth-child(6)) { min-width: 50rem; }
table.values td:nth-child(6) { white-space: nowrap; }
table.values tr:first-child th { color: var(--soft); }
table.values th { font-weight: 500; }
pre { background: var(--paper); border: 1px solid var(--rule); border-radius: 8px;
  padding: .6rem .9rem; margin: .5rem 0; white-space: pre-wrap; overflow-wrap: anywhere; }
figure { margin: 0 0 .5rem; }
figcaption { color: var(--soft); font-size: .85rem; margin-top: .35rem; max-width: 75ch; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(25rem, 100%), 1fr));
  gap: 1.25rem 2rem; }
.chart svg { width: 100%; height: auto; max-width: 46rem; }
.chart svg text { font-family: inherit !important; }
.legends { display: flex; flex-wrap: wrap; gap: .5rem 2.5rem; margin: .5rem 0 1rem; }
.legend { display: flex; flex-wrap: wrap; align-items: center; gap: .25rem .75rem;
  font-size: .82rem; color: var(--soft); }
.ramp { width: min(15rem, 70vw); height: .75rem; border-radius: 3px; }
.ticks { display: flex; justify-content: space-between; font-variant-numeric: tabular-nums; }
.missing { display: inline-block; width: .75rem; height: .75rem; border-radius: 3px;
  background: rgb(128 128 128); margin-right: .35rem; }
.swatches { display: flex; flex-wrap: wrap; gap: .25rem 1.25rem; font-size: .82rem; color: var(--soft);
  margin-bottom: 1rem; }
.swatches img { display: inline-block; width: 1.5rem; height: 1rem; border-radius: 3px;
  margin-right: .35rem; outline: 1px solid var(--rule); vertical-align: -.15rem; }
#view3d { padding: .75rem; margin-top: .5rem; position: relative; }
#view3d .stage { position: relative; background: var(--stage); border-radius: 4px; }
#view3d canvas { display: none; width: 100%; height: min(clamp(17rem, 52vh, 50rem), 84vw); border-radius: 4px;
  outline: 1px solid var(--rule); cursor: grab; touch-action: none; }
#view3d .stage > img { height: min(clamp(17rem, 52vh, 50rem), 84vw); object-fit: contain; background: #fff; }
#view3d canvas:focus-visible { outline: 3px solid var(--accent); }
#view3d .tools, #view3d .swatches { display: none; }
#view3d.live canvas { display: block; } #view3d.live .stage > img { display: none; }
#view3d.live .tools { display: flex; flex-wrap: wrap; gap: .25rem .75rem; align-items: center;
  margin-top: .5rem; }
#view3d.live:has([name=cameras]:checked) .swatches { display: flex; }
#view3d .swatches { margin: .5rem 0 0; }
#view3d .swatches svg { vertical-align: -.2rem; background: #fff; border-radius: 3px; }
#view3d .note { font-size: .85rem; margin: .25rem 0 0; max-width: none; }
#view3d:fullscreen { background: var(--panel); overflow: auto; }
#view3d:fullscreen canvas { height: calc(100vh - 7rem); }
button, select, input { font: inherit; font-size: .9rem; color: var(--ink); background: var(--paper);
  border: 1px solid var(--rule); border-radius: 8px; padding: .2rem .7rem; min-height: 2.1rem; }
label { font-size: .9rem; min-height: 2.1rem; display: inline-flex; align-items: center; gap: .5rem; }
input[type=checkbox] { width: 1.15rem; height: 1.15rem; }
details { margin-top: .75rem; }
a { color: var(--accent); }
summary { cursor: pointer; color: var(--accent); }
dt { font-weight: 600; } dd { margin: 0 0 .5rem; color: var(--soft); }
@media (max-width: 40rem) {
  main { padding: .75rem .75rem 3rem; }
  section, details.part { padding: .75rem 1rem; }
  #view3d .note, #view3d [data-key="+"], #view3d [data-key="-"] { display: none; }
  table.pictures, table.pictures tbody { display: block; }
  table.pictures { min-width: calc(var(--columns) * 6rem); }
  table.pictures tr { display: grid; grid-template-columns: repeat(var(--columns), minmax(0, 1fr)); }
  table.pictures tr > :first-child { grid-column: 1 / -1; width: auto; white-space: normal; }
  table.pictures tr:first-child > :first-child { display: none; }
}
@media print {
  #view3d.live canvas, #view3d.live .tools, .note, nav, button, dialog, details:not([open]) { display: none; }
  #view3d.live .stage > img { display: block; height: 9cm; }
  body { background: none; } section { break-inside: avoid-page; }
  section, details.part { border: 0; padding: 0; }
  table.pictures { min-width: 0; } tr { break-inside: avoid; } }
"""


def html_page(title: str, allowed: str, body: str, css: str = "") -> str:
    """Return a page; ``allowed`` is what browsers let it load, ``css`` comes after the style sheet."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{allowed}">\n'
        f"<title>{escape(title)}</title>\n<style>{CSS}{css}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


UNKNOWN = "–"  # noqa: RUF001 (a dash, not a minus)


def section(title: str, intro: str, *body: str, name: str = "") -> str:
    """Return a titled section with an introductory sentence, and a name that links lead to."""
    at = f" id={name}" if name else ""
    return f"<section{at}><h2>{escape(title)}</h2><p>{escape(intro)}</p>{''.join(body)}</section>"


def part(name: str, title: str, fact: str, *body: str) -> str:
    """Return a part that opens on click, or by a link to its name; ``fact`` says what is in it."""
    head = f"<summary><h2>{escape(title)}</h2><span>{escape(fact)}</span></summary>"
    return f"<details class=part id={name}>{head}{''.join(body)}</details>"


def card(label: str, value: str, word: str, note: str, term: str, kind: str = "") -> str:
    """Return one key number with a word that explains it; the label leads to an entry of the glossary.

    Args:
        label: what is measured.
        value: the number with its unit.
        word: explains the number.
        note: of what it is.
        term: of the glossary.
        kind: "good" or "poor" where the word is a judgement.
    """
    return (
        f'<div class=card><a href="#{term}">{escape(label)}</a><b>{escape(value)}</b>'
        f"<em class={kind or 'plain'}>{escape(word)}</em><small>{escape(note)}</small></div>"
    )


def picture(uri: str, alt: str, width: int, height: int) -> str:
    """Return an image of known size."""
    return f'<img src="{escape(uri)}" alt="{escape(alt)}" width="{width}" height="{height}">'


def figure(body: str, caption: str) -> str:
    """Return a figure with a caption; ``body`` is HTML."""
    return f"<figure>{body}<figcaption>{escape(caption)}</figcaption></figure>"


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
