"""Progress: bars on a terminal, a line now and then in a log, and nothing where nobody wants it."""

import logging
import sys
from collections.abc import Iterator

import pytest

from digs_warp.record import progress as module
from digs_warp.record.progress import progress, show_progress


@pytest.fixture
def shown() -> Iterator[None]:
    show_progress()
    yield
    show_progress(False)


def count_to_three(label: str) -> None:
    with progress(3, label, "frame") as bar:
        for _ in range(3):
            bar.update()


def test_progress_is_silent_until_turned_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    count_to_three("quiet")
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("shown")
def test_a_terminal_shows_bars(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    count_to_three("loud")
    assert "loud: 100%" in capsys.readouterr().err


@pytest.mark.usefixtures("shown")
@pytest.mark.parametrize(
    ("value", "has_bars"), [("1", False), ("true", False), ("0", True), ("", True)]
)
def test_tqdm_disable_turns_bars_off(
    value: str, has_bars: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TQDM_DISABLE", value)
    count_to_three("bar")
    assert bool(capsys.readouterr().err) == has_bars


@pytest.mark.usefixtures("shown")
def test_a_log_has_no_bars_and_no_line_of_a_short_stage(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    count_to_three("short")
    assert capsys.readouterr().err == ""
    assert caplog.records == []


@pytest.mark.usefixtures("shown")
def test_a_long_stage_logs_a_line_every_half_minute_with_an_estimate(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO)
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
