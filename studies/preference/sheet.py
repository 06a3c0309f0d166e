"""The page on which a participant answers: kept in the browser, saved as CSV; it names no strategy."""

from collections.abc import Sequence
from html import escape
from importlib.resources import files

from studies.preference.design import LETTERS, Question

# Browsers refuse whatever the page would send or load, but for the videos beside it.
_ALLOWED = (
    "default-src 'none'; media-src 'self' file:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; form-action 'none'"
)

_STYLE = """
:root { color-scheme: light dark; --ink: #1d2430; --soft: #5d6b7e; --paper: #f6f7f9; --panel: #fff;
  --rule: #c9d1db; --accent: #1f66b8; --on-accent: #fff; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6eaf0; --soft: #a3b0c0; --paper: #12161c;
  --panel: #1a2029; --rule: #435063; --accent: #8fc1f7; --on-accent: #10151b; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 17px/1.5 system-ui, sans-serif; }
main { max-width: 60rem; margin: 0 auto; padding: 1.5rem 1rem 8rem; }
h1 { font-size: 1.6rem; margin: 0; }
fieldset { border: 1px solid var(--rule); border-radius: 12px; background: var(--panel);
  margin: 1.5rem 0; padding: 1rem; min-width: 0; break-inside: avoid; }
legend { font-weight: 600; padding: 0 .5rem; }
video { display: block; width: 100%; height: auto; border-radius: 6px; }
.choices { display: grid; grid-template-columns: 1fr 1fr; gap: .5rem; max-width: 26rem; }
.choices label { display: flex; align-items: center; gap: .75rem; min-height: 3rem; padding: 0 1rem;
  border: 1px solid var(--rule); border-radius: 8px; font-size: 1.2rem; }
.choices label:has(:checked) { border: 2px solid var(--accent); font-weight: 700; }
input[type=radio] { width: 1.3rem; height: 1.3rem; accent-color: var(--accent); }
input[type=text] { font: inherit; color: inherit; background: var(--panel); border: 1px solid var(--rule);
  border-radius: 8px; padding: .5rem .75rem; width: min(20rem, 100%); display: block; }
label:focus-within, button:focus-visible, input[type=text]:focus-visible {
  outline: 3px solid var(--accent); outline-offset: 2px; }
footer { position: fixed; inset: auto 0 0; background: var(--panel); border-top: 1px solid var(--rule);
  padding: .6rem 1rem; display: flex; flex-wrap: wrap; gap: .5rem 1rem; align-items: center; }
#status { flex: 1 1 14rem; font-size: .9rem; overflow-wrap: anywhere; }
button { font: inherit; min-height: 2.75rem; padding: 0 1.1rem; border-radius: 8px;
  border: 1px solid var(--accent); background: var(--accent); color: var(--on-accent); }
button[type=button] { background: none; color: inherit; }
button[hidden] { display: none; }
@media print { footer { display: none; } video { display: none; } }
"""


def sheet_page(questions: Sequence[Question]) -> str:
    """Return the page of one version; its questions are at least one."""
    version = questions[0].version
    script = (files("studies.preference") / "sheet.js").read_text("utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{_ALLOWED}">'
        f"<title>Answer sheet, version {version}</title><style>{_STYLE}</style></head><body><main>"
        f"<h1>Answer sheet, version {version}</h1>"
        "<p>Each video shows the same object four times. Watch it as often as you like, then choose one "
        "letter per question. Your answers stay on this device until you save them as a file.</p>"
        "<noscript><p><strong>Without JavaScript this page saves nothing: fill in answers.csv.</strong></p>"
        f'</noscript><form id=sheet data-version={version} autocomplete="off">'
        "<label>Your name or number <input type=text name=participant required></label>"
        f"{''.join(map(_question, questions))}"
        "<footer><output id=status role=status></output>"
        "<button type=button id=again hidden>Clear, for the next participant</button>"
        "<button>Save the answers</button></footer></form></main>"
        f'<script>"use strict";(() => {{\n{script}}})();</script></body></html>\n'
    )


def _question(question: Question) -> str:
    number = question.number
    choices = "".join(
        f"<label><input type=radio name=question-{number} value={letter}> {escape(letter)}</label>"
        for letter in LETTERS
    )
    return (
        f"<fieldset data-question={number}><legend>Question {number}</legend>"
        f'<video src="question-{number}.mp4" controls loop muted playsinline preload=metadata '
        f'aria-label="Four pictures: A and B above, C and D below"></video>'
        f"<p>Which of the four looks best? A and B are above, C and D below.</p>"
        f"<div class=choices>{choices}</div></fieldset>"
    )
