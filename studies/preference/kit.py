"""Make the kit: one synchronized 2x2 video per question, answer sheets, and the key."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.files import write_atomically
from digs_warp.record.layout import GAUSSIANS, find_gaussians
from digs_warp.record.progress import progress
from digs_warp.words import counted
from studies.preference.design import KEY, LETTERS, VERSIONS, Question, design, save_key
from studies.preference.sheet import sheet_page

FOV_DEG = 45.0
GAP = 6  # [px] between the pictures
SHEET_COLUMNS = ("participant", "version", "question", "choice")


def find_items(folders: Sequence[Path]) -> dict[str, dict[str, Gaussians]]:
    """Return item -> what is compared -> Gaussians, from folders that hold a folder per reconstruction.

    Raises:
        DigsError: a folder is missing, two have the same name, or they compare different things.
    """
    found = {folder.name: _reconstructions(folder) for folder in folders}
    if len(found) != len(folders):
        raise DigsError("preference: two items have the same folder name; rename one")
    names = {tuple(paths) for paths in found.values()}
    if len(names) > 1:
        raise DigsError(
            f"preference: the items compare different things: {sorted(names)}; expected the same four "
            "folder names in each"
        )
    compared = names.pop() if names else ()
    if len(compared) != len(LETTERS):
        raise DigsError(
            f"'{folders[0]}': {counted(len(compared), 'folder')} in it ({', '.join(compared) or 'none'}), "
            f"expected {len(LETTERS)}, one per reconstruction"
        )
    return {
        item: {name: Gaussians.load(path) for name, path in paths.items()}
        for item, paths in found.items()
    }


def _reconstructions(item: Path) -> dict[str, Path]:
    if not item.is_dir():
        raise DigsError(f"'{item}': no such folder; expected four reconstructions in it")
    if (item / GAUSSIANS).exists():
        raise DigsError(
            f"'{item}': is one reconstruction; expected a folder with four of them, named after what is "
            "compared"
        )
    folders = sorted(path for path in item.iterdir() if path.is_dir())
    return {folder.name: find_gaussians(folder) for folder in folders}


def make_kit(
    items: Mapping[str, Mapping[str, Gaussians]],
    folder: Path,
    *,
    size: tuple[int, int],
    seconds: float,
    frame_rate: float,
) -> list[Question]:
    """Write the kit and return its questions.

    In ``folder``: version-1 to version-4, each with question-N.mp4, sheet.html and answers.csv, and key.json.

    Args:
        items: item -> strategy -> Gaussians; the same four strategies for every item.
        folder: new or empty.
        size: width and height of one of the four pictures [px].
        seconds: of a turn around the object.
        frame_rate: frames per second.

    Raises:
        DigsError: not four strategies, or a video that cannot be written.
    """
    from digs_warp.show.film.video import write_video

    strategies = list(next(iter(items.values()), {}))
    questions = design(list(items), strategies)
    count = max(1, round(seconds * frame_rate))
    with progress(len(items), "Filming", "item") as bar:
        for item, results in items.items():
            films = _films(results, size, count)
            for question in (q for q in questions if q.item == item):
                path = _version(folder, question.version) / f"question-{question.number}.mp4"
                write_video(path, _arranged(films, question), frame_rate)
            bar.update()
    for version in range(1, VERSIONS + 1):
        mine = [question for question in questions if question.version == version]
        rows = [",".join(SHEET_COLUMNS), *(f",{version},{question.number}," for question in mine)]
        write_atomically(_version(folder, version) / "sheet.html", sheet_page(mine).encode())
        write_atomically(_version(folder, version) / "answers.csv", "\n".join([*rows, ""]).encode())
    save_key(questions, folder / KEY)
    return questions


def _version(folder: Path, version: int) -> Path:
    return folder / f"version-{version}"


def _films(
    results: Mapping[str, Gaussians], size: tuple[int, int], count: int
) -> dict[str, list[np.ndarray]]:
    """Return the frames of every strategy, seen by the same cameras."""
    from digs_warp.show.film.camera_path import find_framed_subject, orbit
    from digs_warp.show.film.video import shoot

    # Far stray Gaussians would make the object look small, so the tightest result defines the view.
    subject = min(map(find_framed_subject, results.values()), key=lambda subject: subject.radius)
    cameras = orbit(subject, Intrinsics.from_fov(*size, FOV_DEG), count)
    return {
        name: list(shoot(gaussians, cameras, center_world=subject.center_world))
        for name, gaussians in results.items()
    }


def _arranged(
    films: Mapping[str, Sequence[np.ndarray]], question: Question
) -> Iterator[np.ndarray]:
    """Yield the frames of a question's video: four pictures with their letters."""
    for pictures in zip(*(films[question.places[letter]] for letter in LETTERS), strict=True):
        a, b, c, d = map(_lettered, pictures, LETTERS)
        height, width = a.shape[:2]
        grid = np.full((2 * height + GAP, 2 * width + GAP, 3), 128, np.uint8)
        grid[:height, :width], grid[:height, -width:] = a, b
        grid[-height:, :width], grid[-height:, -width:] = c, d
        yield grid


def _lettered(frame: np.ndarray, letter: str) -> np.ndarray:
    import cv2

    size = max(0.5, frame.shape[0] / 300)
    place = (round(12 * size), round(30 * size))
    marked = np.ascontiguousarray(frame)
    cv2.putText(
        marked, letter, place, cv2.FONT_HERSHEY_SIMPLEX, size, (60, 60, 60), round(2 * size)
    )
    return marked
