"""One page with the curves of all tests, for people who did not run them."""

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from digs_warp.record.files import write_atomically
from digs_warp.sim.testing.curve import DegradationCurve
from digs_warp.words import counted

MARKER = "sensor_noise"

_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 52rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; }
h2 { font-size: 1rem; overflow-wrap: anywhere; margin: 2rem 0 .3rem; }
p { margin: .3rem 0; overflow-wrap: anywhere; }
table { border-collapse: collapse; width: 100%; }
td, th { text-align: right; padding: .1rem .8rem .1rem 0; font-weight: normal; white-space: nowrap; }
td:last-child { width: 70%; padding-right: 0; }
.bar { background: #3b76af; height: .8rem; min-width: 1px; }
.failed { color: #b3261e; }
@media (prefers-color-scheme: dark) {
  body { background: #16181c; color: #e6e6e6; }
  .failed { color: #ff8a80; }
}
"""


@dataclass(frozen=True)
class Measured:
    """What a test measured.

    Attributes:
        test: its id.
        outcome: "passed", "failed" or "skipped".
        of: the name of the function that was measured; empty without a curve.
        curve: its errors; None: the test failed before there was one.
        why: the first line of what made the test fail; empty if it did not.
    """

    test: str
    outcome: str
    of: str = ""
    curve: DegradationCurve | None = None
    why: str = ""


class SummaryWriter:
    """Collects the curves of a run, in one process or several, and writes the page at its end.

    Args:
        path: the page.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._measured: list[Measured] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what a test measured, or why it failed before it did."""
        if report.when != "call" and not report.failed:
            return
        values: list[Any] = [value for name, value in report.user_properties if name == MARKER]
        outcome, why = report.outcome, _why(report)
        for value in values if report.when == "call" else ():
            curve = DegradationCurve(tuple(value["strengths"]), tuple(value["errors"]))
            self._measured.append(Measured(report.nodeid, outcome, value["of"], curve, why))
        if report.failed and not values and MARKER in report.keywords:
            self._measured.append(Measured(report.nodeid, outcome, why=why))

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the page; processes that only run tests leave that to the one that started them."""
        if not hasattr(session.config, "workerinput"):
            write_atomically(self._path, summary_page(self._measured).encode())


def summary_page(measured: Sequence[Measured]) -> str:
    """Return the page, complete in itself; what failed comes first."""
    curves = sum(each.curve is not None for each in measured)
    failed = len({each.test for each in measured if each.outcome == "failed"})
    count = counted(curves, "curve") + (f", {counted(failed, 'test')} failed" if failed else "")
    in_order = sorted(measured, key=lambda each: each.outcome != "failed")
    sections = "".join(map(_section, in_order))
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width"><title>Sensor noise</title>'
        f"<style>{_STYLE}</style><h1>Errors at rising sensor noise</h1>"
        f"<p>{count}. Strength 0 is perfect depth, or a recording as it is; 1 has the errors of the real "
        "camera, 2 twice these. Errors are what the tests measured, in their own units; a bar is the share "
        f"of the largest in its table.</p>{sections}</html>"
    )


def _why(report: pytest.TestReport) -> str:
    crash = getattr(report.longrepr, "reprcrash", None)
    return crash.message.splitlines()[0] if report.failed and crash and crash.message else ""


def _section(measured: Measured) -> str:
    outcome = f'<span class="{measured.outcome}">{measured.outcome}</span>'
    text = f"<h2>{html.escape(measured.test)}: {outcome}</h2>"
    if measured.why:
        text += f"<p>{html.escape(measured.why)}</p>"
    if measured.curve is None:
        return text + "<p>It failed before an error was measured at all strengths.</p>"
    head = "<tr><th>strength</th><th>error</th><th></th></tr>"
    rows = "".join(_rows(measured.curve))
    return f"{text}<p><code>{html.escape(measured.of)}</code></p><table>{head}{rows}</table>"


def _rows(curve: DegradationCurve) -> Iterable[str]:
    for strength, error, share in zip(curve.strengths, curve.errors, curve.shares(), strict=True):
        bar = f'<div class="bar" style="width:{100 * share:.1f}%"></div>'
        yield f"<tr><td>{strength:g}</td><td>{error:.4g}</td><td>{bar}</td></tr>"
