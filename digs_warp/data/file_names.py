"""Finds files by names that differ a little: names from another system, or the mask of an image."""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePath, PurePosixPath

from digs_warp.checks import CaptureError


def is_readable(path: Path) -> bool:
    """Whether there is a file; False for names that the system does not allow."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long; with a NUL
        return False


def _folded(name: str) -> str:
    """Return a name without what systems write differently: case, and letters with their accents apart."""
    return unicodedata.normalize("NFC", name.lower())


def folder_named(folder: Path, name: str) -> Path:
    """Return a folder below another by its path, where it is written in another case, too."""
    for part in PurePosixPath(name).parts:
        exact = folder / part
        near = (
            (p for p in folder.iterdir() if _folded(p.name) == _folded(part))
            if folder.is_dir()
            else ()
        )
        folder = exact if exact.is_dir() else next(iter(near), exact)
    return folder


# Suffixes of image folders: the images themselves, then reduced copies such as images_2.
SMALLER = ("", "_2", "_4", "_8")


class FileNames:
    """Finds the files that an index names, which may come from another system.

    Attributes:
        folder: of the recording.
        notes: of names that are not exactly those of the files, see `Recording`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.notes: Counter[str] = Counter()
        self._listed: dict[Path, dict[str, str]] = {}

    def find(self, name: str, endings: Sequence[str] = ("",)) -> Path | None:
        """Return the file of a name, or None.

        The name may lack one of the ``endings``, have backslashes, letters in another case or the path of
        another machine, or be in a folder such as images of which only images_2 is there.
        """
        exact = (Path(f"{self.folder / name}{end}") for end in endings)
        if (found := next(filter(is_readable, exact), None)) is not None:
            return found
        found = self._likely(name, endings)
        # A bare name could be that of an image as well as of its depth.
        if found is None or ("/" not in found and re.search(r"[/\\]", name.removeprefix("./"))):
            return None
        self.notes["names in the index differ from those of the files, which are taken"] += 1
        return self.folder / found

    def require(self, name: str, where: str, endings: Sequence[str] = ("",)) -> Path:
        """Return the file of a name; raise a `CaptureError` with the likely right name if there is none."""
        if (found := self.find(name, endings)) is not None:
            return found
        likely = self._likely(name, endings)
        if likely is not None:
            raise CaptureError(
                f"{where}: '{name}' does not exist, but '{likely}' does; correct the name"
            )
        raise CaptureError(
            f"{where}: '{name}' does not exist in '{self.folder}'; copy it there, or correct the name"
        )

    def _likely(self, name: str, endings: Sequence[str]) -> str | None:
        parts = [part for part in re.split(r"[/\\]", name) if part not in ("", ".", "..")]
        for n in range(len(parts)):
            head, *rest = parts[n:]
            for size in SMALLER if rest else ("",):
                for end in endings:
                    tail = [f"{head}{size}", *rest]
                    tail[-1] += end
                    if (found := self._in_any_case(tail)) is not None:
                        return found
        return None

    def _in_any_case(self, parts: Sequence[str]) -> str | None:
        """Return the path below the folder that differs in case or accents only, if there is one."""
        found: list[str] = []
        for part in parts:
            here = self._names(self.folder.joinpath(*found))
            if _folded(part) not in here:
                return None
            found.append(here[_folded(part)])
        return "/".join(found) if is_readable(self.folder.joinpath(*found)) else None

    def _names(self, place: Path) -> dict[str, str]:
        if place not in self._listed:
            try:
                self._listed[place] = {_folded(path.name): path.name for path in place.iterdir()}
            except OSError:
                self._listed[place] = {}
        return self._listed[place]


MASK_SUFFIXES = (".png", ".jpg", ".jpeg", ".npy", ".npz", ".exr", ".tif", ".tiff", ".bmp", ".webp")


def masks_in(folder: Path, images: Sequence[str]) -> tuple[dict[str, Path], int]:
    """Return the mask files of images by the image's name, and how many files fit no image.

    The mask of 0001.jpg is 0001.jpg.png, 0001.png, 0001_mask.png or mask_0001.png, in letters of any case and
    with any suffix of images.

    Args:
        folder: of the masks; may be missing.
        images: paths relative to the folder of images, with slashes.
    """
    paths = [each for each in sorted(folder.rglob("*")) if each.suffix.lower() in MASK_SUFFIXES]
    files = {_stem(path.relative_to(folder)): path for path in paths}

    def of(image: str) -> Path | None:
        name = PurePosixPath(_folded(image))
        stems = [_stem(each) for each in (name, PurePosixPath(name.name))]
        tried = [str(name), name.name]
        tried += [form.format(*stem.rpartition("/")) for stem in stems for form in _MASK_NAMES]
        return next((files[each] for each in tried if each in files), None)

    found = {image: path for image in images if (path := of(image)) is not None}
    return found, len(files) - len(set(found.values()))


_MASK_NAMES = ("{0}{1}{2}", "{0}{1}{2}_mask", "{0}{1}mask_{2}", "{0}{1}{2}.mask")


def _stem(path: PurePath) -> str:
    return _folded(path.with_suffix("").as_posix())
