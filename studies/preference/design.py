"""The order of the strategies on screen, a Latin square, and the key that decodes the answers.

Over the four versions of a kit, every strategy appears once in every place of every question and follows
every other strategy once (a Williams square), so neither place nor neighbor can favor it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json, to_json, write_atomically

LETTERS = ("A", "B", "C", "D")  # top left, top right, bottom left, bottom right
SQUARE = ((0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1))
VERSIONS = len(SQUARE)
KEY = "key.json"


@dataclass(frozen=True)
class Question:
    """One video; ``places`` maps the letters to strategies."""

    version: int
    number: int
    item: str
    places: dict[str, str]


def design(items: Sequence[str], strategies: Sequence[str]) -> list[Question]:
    """Return all questions of all versions; both are numbered from 1.

    Raises:
        DigsError: not four different strategies, or no items.
    """
    if len(set(strategies)) != len(LETTERS):
        raise DigsError(
            f"preference: strategies {list(strategies)}, expected {len(LETTERS)} different ones"
        )
    if not items:
        raise DigsError("preference: no items, expected at least one")
    found = []
    for version, number in product(range(VERSIONS), range(len(items))):
        row = SQUARE[(version + number) % VERSIONS]
        places = {letter: strategies[place] for letter, place in zip(LETTERS, row, strict=True)}
        found.append(Question(version + 1, number + 1, items[number], places))
    return found


def save_key(questions: Sequence[Question], path: Path) -> None:
    """Write the meaning of the letters, which participants must not see."""
    rows = [vars(question) for question in questions]
    write_atomically(path, to_json({"questions": rows}).encode())


def load_key(path: Path) -> dict[tuple[int, int], dict[str, str]]:
    """Return strategies by letter for each (version, question).

    Raises:
        DigsError: the file is missing or not a key.
    """
    remedy = f"name the {KEY} that 'python -m studies preference make' wrote"
    content = read_json(path, "key of a preference kit")
    key = Fields(content, f"'{path}': not the key of a preference kit", remedy=remedy)
    return {
        (row.whole("version"), row.whole("number")): {
            letter: places.text(letter) for letter in LETTERS
        }
        for row in key.sections("questions")
        for places in [row.section("places")]
    }
