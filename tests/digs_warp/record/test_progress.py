"""Progress: bars on a terminal, a line now and then in a log, and nothing where nobody wants it."""

import logging
import sys
from collections.abc import Iterator

import pytest

from digs_warp.record import progress as module
from digs_warp.record.progress import progress, show_progress
from digs_warp.record.run_log import RunLog


@pytest.fixture
def shown() -> Iterator[None]:
    show_progress()
    yield
    show_progress(False)


def count_to_three(label: str) -> None:
    with progress(3, label, "frame") as bar:
        for _ in range(3):
            bar.update()


def test_a_terminal_shows_bars_where_progress_is_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    for shown, disable, has_bars in (
        (False, None, False),
        (True, None, True),
        *((True, value, False) for value in ("1", "true")),
        *((True, value, True) for value in ("0", "")),
    ):
        show_progress(shown)
        if disable is not None:
            monkeypatch.setenv("TQDM_DISABLE", disable)
        count_to_three("bar")
        assert ("bar: 100%" in capsys.readouterr().err) == has_bars, disable


@pytest.mark.usefixtures("shown")
def test_a_log_has_no_bars_but_a_line_every_half_minute_with_an_estimate(
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    caplog.set_level(logging.INFO)
    count_to_three("short")
    assert capsys.readouterr().err == "" and caplog.records == []
    now = 0.0
    monkeypatch.setattr(module.time, "monotonic", lambda: now)
    with progress(200, "Training", initial=100) as bar:
        for step in range(100):
            bar.set_postfix_str(f"loss {step}")
            now += 1.0
            bar.update()
    assert [record.message for record in caplog.records] == [
        "Training: 130 of 200 steps, about 70 s left, loss 29",
        "Training: 160 of 200 steps, about 40 s left, loss 59",
        "Training: 190 of 200 steps, about 10 s left, loss 89",
    ]


@pytest.mark.usefixtures("shown")
def test_every_stage_says_that_it_begins_in_one_line(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    whole, part = RunLog("run", None), RunLog("reconstruct", None)
    with whole.stage("reconstruct"), part.stage("train"):
        pass
    with whole.stage("report"):
        pass
    lines = [record.message for record in caplog.records]
    assert [line.split(" s  ")[1] for line in lines] == ["reconstruct", "  train", "report"]
    assert all(0.0 <= float(line.split()[0]) < 60 for line in lines)
    show_progress(False)
    with whole.stage("export"):
        pass
    assert len(caplog.records) == 3
    assert "\r" not in capsys.readouterr().err
