"""The preference kit: fair places, films that show what the key says, and the evaluation."""

import csv
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.checks import DigsError
from reference.tiny_capture import ball
from studies.preference import LETTERS, design, evaluate, load_key, main, read_answers

STRATEGIES = ("default", "fusion", "highdepth", "random")


def test_every_strategy_stands_once_in_every_place_and_after_every_other() -> None:
    key = design(2, STRATEGIES)
    for number in (1, 2):
        orders = [[key[version, number][a] for a in LETTERS] for version in range(1, 5)]
        for place in range(4):
            assert sorted(order[place] for order in orders) == sorted(STRATEGIES)
        assert len({pair for order in orders for pair in pairwise(order)}) == 12
    assert key[1, 1] != key[1, 2]


@pytest.fixture(scope="module")
def kit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A kit of one item, whose strategies are balls of four brightnesses."""
    folder = tmp_path_factory.mktemp("preference")
    for number, strategy in enumerate(STRATEGIES):
        gaussians = ball(200)
        gaussians.log_scales[:] = np.log(0.06)  # without gaps
        gaussians.sh[:, 0] = number / 1.5 - 1.0
        gaussians.save(folder / "mug" / strategy / "gaussians.npz")
    size = "--size 48 32 --seconds 0.25 --fps 8".split()
    main(["make", str(folder / "mug"), "--out", str(folder / "kit"), *size])
    return folder / "kit"


def test_each_quarter_of_a_film_shows_what_the_key_says(kit: Path) -> None:
    key = load_key(kit / "key.json")
    for version in range(1, 5):
        frame = cv2.VideoCapture(str(kit / f"version-{version}/question-1.mp4")).read()[1]
        height, width = frame.shape[0] // 2, frame.shape[1] // 2
        centers = [
            frame[row + 12 : row + 20, column + 20 : column + 28].mean()
            for row in (0, frame.shape[0] - height)
            for column in (0, frame.shape[1] - width)
        ]
        shown = [key[version, 1][LETTERS[i]] for i in np.argsort(centers)]
        assert shown == list(STRATEGIES)  # from dark to bright
        assert not any(
            s in (kit / f"version-{version}/answers.csv").read_text() for s in STRATEGIES
        )


def test_filled_sheets_are_evaluated(kit: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key = load_key(kit / "key.json")
    sheets = []
    for person in range(24):
        version = person % 4 + 1
        wanted = "highdepth" if person < 18 else "fusion"
        letter = next(a for a, strategy in key[version, 1].items() if strategy == wanted)
        (row,) = csv.DictReader((kit / f"version-{version}" / "answers.csv").open())
        row |= {"participant": f"p{person}", "choice": letter.lower()}
        sheets.append(kit / f"filled-{person}.csv")
        sheets[-1].write_text(f"{','.join(row)}\n{','.join(row.values())}\n")
    main(["evaluate", *map(str, sheets), "--key", str(kit / "key.json")])
    text = capsys.readouterr().out
    assert "highdepth       18   75.0 %" in text
    # (18-6)^2 + (6-6)^2 + 2 (0-6)^2, over 6
    assert "24 answers of 24 participants" in text and "chi-square 36.00" in text


@pytest.mark.parametrize("row", ["p,1,1,E", "p,9,1,A", "p,one,1,A"])
def test_answers_that_do_not_fit_the_key_are_refused(kit: Path, tmp_path: Path, row: str) -> None:
    path = tmp_path / "answers.csv"
    path.write_text(f"participant,version,question,choice\n{row}\n")
    with pytest.raises(DigsError, match=r"line 2: .* does not fit the key"):
        read_answers(path, load_key(kit / "key.json"))


def test_what_cannot_be_compared_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="no answers"):
        evaluate([], STRATEGIES)
    ball(20).save(tmp_path / "mug/default/gaussians.npz")
    with pytest.raises(DigsError, match="holds the folders default; expected the same 4"):
        main(["make", str(tmp_path / "mug"), "--out", str(tmp_path / "kit")])
