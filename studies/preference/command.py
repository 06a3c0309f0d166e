"""`python -m studies preference make|evaluate`: ask people which reconstruction they prefer."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.words import counted
from studies.preference.design import KEY, VERSIONS, load_key
from studies.preference.evaluate import evaluate, read_answers
from studies.preference.kit import find_items, make_kit


def main(words: Sequence[str]) -> None:
    """Film four reconstructions side by side in four versions, or count filled answer sheets."""
    parser = argparse.ArgumentParser(prog="python -m studies preference")
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="films, answer sheets and a secret key")
    make.add_argument(
        "items",
        nargs="+",
        type=Path,
        metavar="ITEM",
        help="folders, one per question, each with the same four subfolders with reconstructions of one "
        "object, named after what is compared, for example default, highdepth, fusion and random",
    )
    make.add_argument("--out", type=Path, required=True, help="new folder of the kit")
    make.add_argument("--seconds", type=float, default=8.0, help="length of a turn [s]")
    make.add_argument("--fps", type=float, default=24.0, help="frames per second")
    make.add_argument("--size", type=int, nargs=2, default=(480, 360), help="of each picture [px]")
    count = commands.add_parser("evaluate", help="is the preference chance? (chi-square test)")
    count.add_argument("sheets", nargs="+", type=Path, metavar="SHEET", help="filled CSV files")
    count.add_argument("--key", type=Path, required=True, help="the key.json of the kit")
    given = parser.parse_args(words)
    found = _make(given) if given.command == "make" else _evaluate(given.sheets, given.key)
    sys.stdout.write(f"{found}\n")


def _make(given: argparse.Namespace) -> str:
    if given.out.exists() and any(given.out.iterdir()):
        raise DigsError(f"--out '{given.out}': the folder is not empty; name another")
    items = find_items(given.items)
    size = (given.size[0], given.size[1])
    make_kit(items, given.out, size=size, seconds=given.seconds, frame_rate=given.fps)
    return (
        f"{given.out}: {VERSIONS} versions of {counted(len(items), 'question')}. Give the next participant "
        f"the next version (sheet.html and its videos); the page saves the answers as a CSV file. Keep "
        f"{KEY} to yourself."
    )


def _evaluate(sheets: Sequence[Path], key_file: Path) -> str:
    key = load_key(key_file)
    strategies = sorted({name for places in key.values() for name in places.values()})
    answers = [answer for path in sheets for answer in read_answers(path, key)]
    return evaluate(answers, strategies).text()
