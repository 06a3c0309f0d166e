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
body { font: 16px/1.5 system-ui, sans-serif; max-width: 52rem; margin: 2rem auto; padding: 0 1rem; }
h2 { font-size: 1rem; overflow-wrap: anywhere; margin: 2rem 0 .3rem; }
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
    """A curve of a test.

    Attributes:
        test: its id.
        outcome: "passed", "failed" or "skipped".
        of: the name of the function that was measured.
        curve: its errors.
    """

    test: str
    outcome: str
    of: str
    curve: DegradationCurve


class SummaryWriter:
    """Collects the curves of a run, in one process or several, and writes the page at its end.

    Args:
        path: the page.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._measured: list[Measured] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what a test measured."""
        if report.when == "call":
            for name, value in report.user_properties:
                if name == MARKER:
                    self._measured.append(_read(report, value))

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the page; processes that only run tests leave that to the one that started them."""
        if not hasattr(session.config, "workerinput"):
            write_atomically(self._path, summary_page(self._measured).encode())


def summary_page(measured: Sequence[Measured]) -> str:
    """Return the page, complete in itself."""
    failed = sum(each.outcome == "failed" for each in measured)
    count = counted(len(measured), "curve") + (f", {failed} of failed tests" if failed else "")
    sections = "".join(map(_section, measured))
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width"><title>Sensor noise</title>'
        f"<style>{_STYLE}</style><h1>Errors at rising sensor noise</h1>"
        f"<p>{count}. Strength 0 is perfect depth, or a recording as it is; 1 has the errors of the real "
        f"camera.</p>{sections}</html>"
    )


def _read(report: pytest.TestReport, value: Any) -> Measured:
    curve = DegradationCurve(tuple(value["strengths"]), tuple(value["errors"]))
    return Measured(report.nodeid, report.outcome, value["of"], curve)


def _section(measured: Measured) -> str:
    outcome = f'<span class="{measured.outcome}">{measured.outcome}</span>'
    title = f"{html.escape(measured.test)}: {html.escape(measured.of)}, {outcome}"
    head = "<tr><th>strength</th><th>error</th><th></th></tr>"
    return f"<h2>{title}</h2><table>{head}{''.join(_rows(measured.curve))}</table>"


def _rows(curve: DegradationCurve) -> Iterable[str]:
    for strength, error, share in zip(curve.strengths, curve.errors, curve.shares(), strict=True):
        bar = f'<div class="bar" style="width:{100 * share:.1f}%"></div>'
        yield f"<tr><td>{strength:g}</td><td>{error:.4g}</td><td>{bar}</td></tr>"
