"""`python -m studies preference make|evaluate`: ask people which of four reconstructions they prefer.

Over the four versions of a kit, every strategy appears once in every place of every question and follows
every other strategy once (a Williams square), so neither place nor neighbor can favor it.
"""

import argparse
import csv
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.record.layout import find_gaussians
from digs_warp.words import counted

LETTERS = ("A", "B", "C", "D")  # top left, top right, bottom left, bottom right
SQUARE = ((0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1))
VERSIONS = len(SQUARE)
COLUMNS = ("participant", "version", "question", "choice")
KEY = "key.json"
FOV_DEG = 45.0
GAP = 6  # [px] between the pictures

# (version, question), from 1 -> letter -> strategy.
Key = Mapping[tuple[int, int], Mapping[str, str]]


def main(words: Sequence[str]) -> None:
    """Film four reconstructions side by side in four versions, or count filled answer sheets."""
    parser = argparse.ArgumentParser(prog="python -m studies preference")
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="films, answer sheets and a secret key")
    what = "a folder with four reconstructions of one object, named after what is compared"
    make.add_argument("items", nargs="+", type=Path, metavar="ITEM", help=what)
    make.add_argument("--out", type=Path, required=True, help="new folder of the kit")
    make.add_argument("--seconds", type=float, default=8.0, help="length of a turn [s]")
    make.add_argument("--fps", type=float, default=24.0, help="frames per second")
    make.add_argument("--size", type=int, nargs=2, default=(480, 360), help="of each picture [px]")
    count = commands.add_parser("evaluate", help="is the preference chance? (chi-square test)")
    count.add_argument("sheets", nargs="+", type=Path, metavar="SHEET", help="filled CSV files")
    count.add_argument("--key", type=Path, required=True, help="the key.json of the kit")
    given = parser.parse_args(words)
    if given.command == "make":
        sys.stdout.write(f"{make_kit(given)}\n")
    else:
        key = load_key(given.key)
        answers = [answer for path in given.sheets for answer in read_answers(path, key)]
        strategies = sorted({name for places in key.values() for name in places.values()})
        sys.stdout.write(f"{evaluate(answers, strategies)}\n")


def design(questions: int, strategies: Sequence[str]) -> Key:
    """Return which strategy stands behind each letter, for every question of every version."""
    return {
        (version + 1, number + 1): {
            letter: strategies[place]
            for letter, place in zip(LETTERS, SQUARE[(version + number) % VERSIONS], strict=True)
        }
        for version in range(VERSIONS)
        for number in range(questions)
    }


def find_items(folders: Sequence[Path]) -> list[dict[str, Gaussians]]:
    """Return the Gaussians by what is compared, for each of the folders.

    Raises:
        DigsError: a folder does not hold four reconstructions, or others than the first one.
    """
    found = [
        {path.name: find_gaussians(path) for path in sorted(folder.glob("*/"))}
        for folder in folders
    ]
    for folder, paths in zip(folders, found, strict=True):
        if len(paths) != len(LETTERS) or paths.keys() != found[0].keys():
            raise DigsError(
                f"'{folder}': holds the folders {', '.join(paths) or '(none)'}; expected the same "
                f"{len(LETTERS)} in each item, a reconstruction in each"
            )
    return [{name: Gaussians.load(path) for name, path in paths.items()} for paths in found]


def make_kit(given: argparse.Namespace) -> str:
    """Write version-1 to version-4, each with question-N.mp4 and answers.csv, and key.json.

    Raises:
        DigsError: the folder is not empty, or the items do not fit.
    """
    from digs_warp.show.film.video import write_video

    if given.out.exists() and any(given.out.iterdir()):
        raise DigsError(f"--out '{given.out}': the folder is not empty; name another")
    items = find_items(given.items)
    key = design(len(items), list(items[0]))
    count = max(1, round(given.seconds * given.fps))
    for number, results in enumerate(items, start=1):
        films = _films(results, given.size, count)
        for version in range(1, VERSIONS + 1):
            path = given.out / f"version-{version}" / f"question-{number}.mp4"
            write_video(path, _arranged(films, key[version, number]), given.fps)
    for version in range(1, VERSIONS + 1):
        rows = [",".join(COLUMNS), *(f",{version},{n + 1}," for n in range(len(items))), ""]
        write_atomically(given.out / f"version-{version}/answers.csv", "\n".join(rows).encode())
    content = [{"version": v, "question": q, **places} for (v, q), places in key.items()]
    write_atomically(given.out / KEY, to_json({"questions": content}).encode())
    return (
        f"{given.out}: {VERSIONS} versions of {counted(len(items), 'question')}. Give the next participant "
        f"the next version; A and B are above, C and D below. Keep {KEY} to yourself."
    )


def _films(
    results: Mapping[str, Gaussians], size: Sequence[int], count: int
) -> dict[str, list[np.ndarray]]:
    """Return the frames of every strategy, seen by the same cameras."""
    from digs_warp.show.film.camera_path import find_framed_subject, orbit
    from digs_warp.show.film.video import shoot

    # Far stray Gaussians would make the object look small, so the tightest result defines the view.
    subject = min(map(find_framed_subject, results.values()), key=lambda subject: subject.radius)
    cameras = orbit(subject, Intrinsics.from_fov(size[0], size[1], FOV_DEG), count)
    return {
        name: list(shoot(gaussians, cameras, center_world=subject.center_world))
        for name, gaussians in results.items()
    }


def _arranged(
    films: Mapping[str, Sequence[np.ndarray]], places: Mapping[str, str]
) -> Iterator[np.ndarray]:
    """Yield the frames of a question's video: four pictures with their letters."""
    for pictures in zip(*(films[places[letter]] for letter in LETTERS), strict=True):
        a, b, c, d = map(_lettered, pictures, LETTERS)
        height, width = a.shape[:2]
        grid = np.full((2 * height + GAP, 2 * width + GAP, 3), 128, np.uint8)
        grid[:height, :width], grid[:height, -width:] = a, b
        grid[-height:, :width], grid[-height:, -width:] = c, d
        yield grid


def _lettered(frame: np.ndarray, letter: str) -> np.ndarray:
    import cv2

    size = max(0.5, frame.shape[0] / 300)
    place, thickness = (round(12 * size), round(30 * size)), round(2 * size)
    marked = np.ascontiguousarray(frame)
    cv2.putText(marked, letter, place, cv2.FONT_HERSHEY_SIMPLEX, size, (60, 60, 60), thickness)
    return marked


def load_key(path: Path) -> Key:
    """Return what `design` made, from its file.

    Raises:
        DigsError: the file is missing or not a key.
    """
    remedy = f"name the {KEY} that 'python -m studies preference make' wrote"
    content = read_json(path, "key of a preference kit")
    key = Fields(content, f"'{path}': not the key of a preference kit", remedy=remedy)
    return {
        (row.whole("version"), row.whole("question")): {x: row.text(x) for x in LETTERS}
        for row in key.sections("questions")
    }


def read_answers(path: Path, key: Key) -> list[tuple[str, str]]:
    """Return participant and preferred strategy for each question with a choice, from a filled CSV file.

    Raises:
        DigsError: the file is missing, has other columns, or a line of it does not fit the key.
    """
    with open(require_file(path, "answers"), newline="", encoding="utf-8-sig") as file:
        rows = list(csv.DictReader(file))
    found = []
    for line, row in enumerate(rows, start=2):
        try:
            choice = (row["choice"] or "").strip().upper()
            if choice:
                places = key[int(row["version"]), int(row["question"])]
                found.append((row["participant"].strip(), places[choice]))
        except (KeyError, ValueError) as error:
            raise DigsError(
                f"answers '{path}', line {line}: {row} does not fit the key ({error}); expected the columns "
                f"{', '.join(COLUMNS)}, a version and question of the same kit, and {', '.join(LETTERS)}"
            ) from None
    return found


def evaluate(answers: Sequence[tuple[str, str]], strategies: Sequence[str]) -> str:
    """Count the answers and test whether they can be chance, including strategies that nobody preferred.

    Args:
        answers: participant and strategy.
        strategies: all that were shown.

    Raises:
        DigsError: no answers.
    """
    from scipy.stats import chisquare

    if not answers:
        raise DigsError("preference: no answers; fill the column 'choice' of the sheets")
    counts = {name: sum(name == given for _, given in answers) for name in strategies}
    test = chisquare(list(counts.values()))
    lines = [
        f"{name:12s} {count:5d}  {100 * count / len(answers):5.1f} %"
        for name, count in sorted(counts.items(), key=lambda entry: -entry[1])
    ]
    lines.append(
        f"{counted(len(answers), 'answer')} of {counted(len(dict(answers)), 'participant')}; equal: "
        f"chi-square {test.statistic:.2f}, {len(counts) - 1} degrees of freedom, p = {test.pvalue:.3g}"
    )
    lines.append("Several answers of one person are not quite independent, as the test assumes.")
    return "\n".join(lines)
