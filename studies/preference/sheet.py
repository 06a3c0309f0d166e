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


def sheet_page(questions: Sequence[Question]) -> str:
    """Return the page of one version; its questions are at least one."""
    version = questions[0].version
    parts = files("studies.preference")
    script, style = ((parts / f"sheet.{kind}").read_text("utf-8") for kind in ("js", "css"))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{_ALLOWED}">'
        f"<title>Answer sheet, version {version}</title><style>\n{style}</style></head><body><main>"
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
