"""The preference kit: fair places, videos and sheets that tell nothing, and the evaluation."""

import csv
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.checks import DigsError
from reference.tiny_capture import ball
from studies.preference.command import main
from studies.preference.design import LETTERS, design, load_key
from studies.preference.evaluate import Answer, evaluate, read_answers
from studies.preference.kit import find_items

STRATEGIES = ("default", "fusion", "highdepth", "random")


def test_every_strategy_stands_once_in_every_place_and_after_every_other() -> None:
    questions = design(["mug", "boot"], STRATEGIES)
    for item in ("mug", "boot"):
        orders = [[q.places[a] for a in LETTERS] for q in questions if q.item == item]
        for place in range(4):
            assert sorted(order[place] for order in orders) == sorted(STRATEGIES)
        followed = {pair for order in orders for pair in pairwise(order)}
        assert len(followed) == 12
    first, second = (q.places for q in questions if q.version == 1)
    assert first != second


@pytest.fixture(scope="module")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A kit of one item, whose strategies are balls of four brightnesses."""
    folder = tmp_path_factory.mktemp("preference")
    for number, strategy in enumerate(STRATEGIES):
        gaussians = ball(200)
        gaussians.log_scales[:] = np.log(0.03)  # without gaps
        gaussians.sh[:, 0] = number / 1.5 - 1.0
        gaussians.log_scales[:] += 0.7  # closed at this size
        (folder / "mug" / strategy).mkdir(parents=True)
        gaussians.save(folder / "mug" / strategy / "gaussians.npz")
    size = "--size 48 32 --seconds 0.25 --fps 8".split()
    out = ["--out", str(folder / "kit")]
    main(["make", str(folder / "mug"), *out, *size])
    return folder / "kit"


def test_each_quarter_of_a_video_shows_what_the_key_says(kit: Path) -> None:
    key = load_key(kit / "key.json")
    for version in range(1, 5):
        video = cv2.VideoCapture(str(kit / f"version-{version}" / "question-1.mp4"))
        frames = [video.read()[1], video.read()[1]]
        assert video.read()[0] is False
        frame = frames[0].astype(float)
        half_height, half_width = frame.shape[0] // 2, frame.shape[1] // 2
        quarters = [
            frame[row : row + half_height, column : column + half_width]
            for row in (0, frame.shape[0] - half_height)
            for column in (0, frame.shape[1] - half_width)
        ]
        centers = [float(q[12:20, 20:28].mean()) for q in quarters]
        places = key[version, 1]
        shown = [places[LETTERS[i]] for i in np.argsort(centers)]
        assert shown == list(STRATEGIES)  # from dark to bright


def test_the_sheets_name_no_strategy(kit: Path) -> None:
    for path in (*kit.glob("version-*/sheet.html"), *kit.glob("version-*/answers.csv")):
        text = path.read_text()
        if path.suffix == ".html":
            text = text[text.index("<main>") : text.rindex("<script>")]  # the same in every kit
        assert not any(strategy in text for strategy in STRATEGIES)
    assert "question-1.mp4" in (kit / "version-3" / "sheet.html").read_text()


def test_filled_sheets_are_evaluated(kit: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key = load_key(kit / "key.json")
    sheets = []
    for person in range(24):
        version = person % 4 + 1
        wanted = "highdepth" if person < 18 else "fusion"
        letter = next(a for a, strategy in key[version, 1].items() if strategy == wanted)
        rows = list(csv.DictReader((kit / f"version-{version}" / "answers.csv").open()))
        rows[0] |= {"participant": f"p{person}", "choice": letter.lower()}
        sheets.append(kit / f"filled-{person}.csv")
        with sheets[-1].open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
    capsys.readouterr()
    main(["evaluate", *map(str, sheets), "--key", str(kit / "key.json")])
    text = capsys.readouterr().out
    assert "highdepth       18   75.0 %" in text
    # (18-6)^2 + (6-6)^2 + 2 (0-6)^2, over 6
    assert "24 answers of 24 participants" in text and "chi-square 36.00" in text


def test_equal_preference_is_chance_and_pairs_are_corrected() -> None:
    equal = [Answer(f"p{i}", STRATEGIES[i % 4]) for i in range(40)]
    outcome = evaluate(equal, STRATEGIES)
    assert outcome.p_value == pytest.approx(1.0)
    lopsided = evaluate([Answer("p", "fusion")] * 10 + [Answer("q", "random")] * 30, STRATEGIES)
    # The chi-square of 10 against 30 is 10, p = 0.00157. Two of the six pairs are clearer: times four.
    assert lopsided.pairs["fusion", "random"] == pytest.approx(4 * 0.001565, rel=0.01)
    assert lopsided.pairs["default", "highdepth"] == 1.0
    assert lopsided.counts["default"] == 0


def test_what_does_not_fit_is_refused(kit: Path, tmp_path: Path) -> None:
    key, path = load_key(kit / "key.json"), tmp_path / "answers.csv"
    for row, message in (
        ("", "no column choice"),
        (",choice\np,1,1,E", "line 2: choice 'E'"),
        (",choice\np,9,1,A", "not in the key"),
        (",choice\np,one,1,A", "not in the key"),
    ):
        path.write_text(f"participant,version,question{row}\n")
        with pytest.raises(DigsError, match=message):
            read_answers(path, key)
    with pytest.raises(DigsError, match="no answers"):
        main(["evaluate", str(kit / "version-1/answers.csv"), "--key", str(kit / "key.json")])
    for strategies in (STRATEGIES[:3], ("a", "a", "b", "c"), ()):
        with pytest.raises(DigsError, match="expected 4 different"):
            design(["mug"], strategies)
    with pytest.raises(DigsError, match="is one reconstruction; expected a folder with four"):
        ball(20).save(tmp_path / "gaussians.npz")
        find_items([tmp_path])
    for item, name in (("mug", "default"), ("boot", "other")):
        ball(20).save(tmp_path / item / name / "gaussians.npz")
    with pytest.raises(DigsError, match="compare different things"):
        main(["make", str(tmp_path / "mug"), str(tmp_path / "boot"), "--out", str(tmp_path / "k")])
