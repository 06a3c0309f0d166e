"""The answer sheet in a real browser: filled by mouse and keyboard, kept over a reload, saved as CSV."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from headless_browser import Browser, NoBrowserError, browser

from digs_warp.data.gaussians import Gaussians
from reference.tiny_capture import ball
from studies.preference.design import load_key
from studies.preference.evaluate import evaluate, read_answers
from studies.preference.kit import make_kit

STRATEGIES = ("default", "fusion", "highdepth", "random")
STATUS = "document.getElementById('status').textContent"
CHOSEN = "[...document.querySelectorAll(':checked')].map((input) => input.name + input.value)"


@pytest.fixture(scope="module")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kit")
    results: dict[str, Gaussians] = {strategy: ball(60) for strategy in STRATEGIES}
    items = {"mug": results, "boot": results}
    make_kit(items, folder, size=(48, 32), seconds=0.25, frame_rate=8)
    return folder


@pytest.fixture(scope="module")
def tab(kit: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    folder = tmp_path_factory.mktemp("browser")
    try:
        with browser(folder / "profile") as opened:
            opened.keep_downloads(kit / "downloads")
            opened.resize(1000, 800)
            yield opened
    except NoBrowserError as error:
        pytest.skip(str(error))


def downloaded(folder: Path, name: str) -> Path:
    end = time.monotonic() + 120
    while not (folder / name).is_file():
        found = sorted(path.name for path in folder.glob("*"))
        assert time.monotonic() < end, f"{name} is not among {found}"
        time.sleep(0.1)
    return folder / name


def test_answers_are_kept_saved_and_evaluated_and_nothing_is_sent(kit: Path, tab: Browser) -> None:
    page = (kit / "version-2/sheet.html").as_uri()
    tab.visit(page)
    assert tab.run(STATUS).startswith("0 of 2 answered.")
    tab.click("input[name=participant]")
    for letter in 'Ö, "7':
        tab.press(letter)
    tab.click("label:has([name=question-1][value=B])")
    tab.run("document.querySelector('[name=question-2]').focus()")
    for key in ("ArrowRight", "ArrowRight", "ArrowRight"):
        tab.press(key)
    assert tab.run(CHOSEN) == ["question-1B", "question-2D"]
    assert tab.run(STATUS) == "2 of 2 answered."
    tab.visit(page)
    assert tab.run(CHOSEN) == ["question-1B", "question-2D"]
    assert tab.run("document.forms[0].participant.value") == 'Ö, "7'
    # What is not in a file yet cannot be cleared.
    assert tab.run("document.getElementById('again').hidden")
    tab.visit((kit / "version-3/sheet.html").as_uri())
    assert tab.run(CHOSEN) == []  # another page, another sheet
    tab.visit(page)
    tab.click("button:not([type])")
    path = downloaded(kit / "downloads", "answers-version-2-Ö-7.csv")
    key = load_key(kit / "key.json")
    answers = read_answers(path, key)
    assert [(a.participant, a.strategy) for a in answers] == [
        ('Ö, "7', key[2, 1]["B"]),
        ('Ö, "7', key[2, 2]["D"]),
    ]
    assert evaluate(answers, STRATEGIES).participants == 1
    tab.wait_for("document.querySelector('video').readyState >= 1")
    known = (*((kit / f"version-{n}").as_uri() for n in (2, 3)), "blob:", "data:")
    assert [url for url in tab.requests if not url.startswith(known)] == []
    text = (kit / "version-2/sheet.html").read_text()
    for call in ("fetch(", "XMLHttpRequest", "WebSocket", "sendBeacon", "import(", "http"):
        assert call not in text.replace('http-equiv="Content-Security-Policy"', "")
    sent = "fetch('http://127.0.0.1:1/').then(() => 'sent', () => 'refused')"
    assert tab.run(sent) == "refused"
    assert not any("127.0.0.1" in url for url in tab.requests)


def test_the_next_participant_starts_with_an_empty_sheet(kit: Path, tab: Browser) -> None:
    tab.visit((kit / "version-4/sheet.html").as_uri())
    assert tab.run("document.getElementById('again').hidden")
    tab.click("label:has([name=question-1][value=A])")
    tab.click("button:not([type])")  # without a name it says so, and saves nothing
    assert "your name or number; question 2" in tab.run(STATUS)
    assert tab.run("document.getElementById('again').hidden")
    tab.click("input[name=participant]")
    tab.press("x")
    tab.click("button:not([type])")
    path = downloaded(kit / "downloads", "answers-version-4-x.csv")
    assert path.read_text() == "participant,version,question,choice\nx,4,1,A\nx,4,2,\n"
    assert "answers-version-4-x.csv" in tab.run(STATUS)
    tab.click("#again")
    assert tab.run(CHOSEN) == []
    tab.visit((kit / "version-4/sheet.html").as_uri())
    assert tab.run(CHOSEN) == [] and tab.run("document.forms[0].participant.value") == ""


@pytest.mark.parametrize("dark", [False, True])
def test_it_fits_a_phone_by_day_and_by_night(kit: Path, tab: Browser, dark: bool) -> None:
    tab.resize(390, 844, dark)
    try:
        tab.visit((kit / "version-1/sheet.html").as_uri())
        assert tab.run("document.documentElement.scrollWidth") <= 390
        tall = "[...document.querySelectorAll('.choices label, button:not([hidden])')]"
        assert tab.run(f"Math.min(...{tall}.map((e) => e.getBoundingClientRect().height))") >= 44
        picture = tab.screenshot().astype(int)
        paper = np.median(picture[:300].reshape(-1, 3), axis=0).mean()
        assert paper < 60 if dark else paper > 230
        # Text stands out: its darkest or brightest pixels in the headline.
        headline = picture[10:70].mean(axis=2)
        assert np.abs(headline - paper).max() > 150
    finally:
        tab.resize(1000, 800)
