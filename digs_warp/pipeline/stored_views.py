"""The views of a stored reconstruction: its frames, the renders of those held out, and their scores.

The scores are written last: with them the folder is complete.
"""

import logging
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.images import read_image, to_uint8, write_image
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.posed_frames import CAMERAS, PosedFrames
from digs_warp.measure.scores import Scores
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.record.layout import CAPTURE, EVALUATION, places_of
from digs_warp.record.manifest import Manifest

logger = logging.getLogger(__name__)

RENDERS = "renders"


def write_scores(folder: Path, scores: Scores) -> None:
    """Write the scores into the folder of a reconstruction."""
    write_atomically(folder / EVALUATION, to_json(scores.to_json()).encode())


def write_render(folder: Path, name: str, image: np.ndarray) -> None:
    """Write a held-out view, values in 0..1, where `Reconstruction.load_render` finds it."""
    write_image(folder / RENDERS / f"{name}.png", to_uint8(image))


def read_render(folder: Path, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return a held-out view; see `Reconstruction.load_render`."""
    path = folder / RENDERS / f"{name}.png"
    pixels = read_image(path, "rendered view")
    if pixels.dtype != np.uint8 or pixels.shape != shape:
        raise DigsError(
            f"rendered view '{path}': {pixels.shape} of {pixels.dtype}, expected {shape} of uint8 "
            "as the capture has; reconstruct again"
        )
    return pixels


def find_capture(folder: Path, recorded: Path | None = None) -> Path | None:
    """Return the capture that a run left in or beside ``folder``, else the ``recorded`` one, else None."""
    noted = () if recorded is None else places_of(recorded, folder)
    beside = folder.absolute().parent / CAPTURE  # of "." the parent is "." itself
    candidates = (folder / CAPTURE, folder.parent / CAPTURE, beside, *noted)
    return next((path for path in candidates if (path / INDEX_NAME).is_file()), None)


def read_scores(path: Path) -> Scores:
    """Return the scores in a file.

    Raises:
        DigsError: it is broken.
    """
    content = read_json(path, "evaluation")
    try:
        return Scores.from_json(content)
    except DigsError as error:
        raise DigsError(
            f"evaluation '{path}': {error}; expected 'mean', and 'views' that each have a 'name'; "
            "reconstruct again"
        ) from error


def find_frames(
    folder: Path, capture: Capture | None, recorded: Path | None = None
) -> tuple[PosedFrames | None, Path | None]:
    """Return the frames as used, and where the capture is; one that nobody named may be broken."""
    if capture is not None:
        return _frames(folder, capture), capture.stored_in
    place = find_capture(folder, recorded)
    if place is None:
        return None, None
    try:
        return _frames(folder, read_capture(place)), place
    except DigsError as error:
        logger.warning("the views of '%s' are not known: %s", folder, error)
        return None, place


def _frames(folder: Path, capture: Capture) -> PosedFrames:
    if (folder / CAMERAS).is_file():
        return PosedFrames.load(capture, folder)
    return PosedFrames.as_recorded(capture)


def is_finished(folder: Path) -> bool:
    """Whether a folder holds a whole reconstruction, all its files as they were written; reads them all."""
    return (folder / EVALUATION).is_file() and Manifest.read(folder).all_whole()
