"""The files that a mesh file names: materials and textures, found by names that other systems wrote.

Windows does not care about upper and lower case or which way slashes lean, so names that worked there need
not work here.
"""

import codecs
import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from digs_warp.bounds import TEXTURE
from digs_warp.checks import DigsError
from digs_warp.words import quoted

logger = logging.getLogger(__name__)

MATERIAL_SUFFIX = ".mtl"
MAX_PLY_HEADER = 1 << 16  # bytes


def obj_materials(path: Path) -> list[str]:
    """Return the material files that an OBJ file names: one a line, or several with blanks between them."""
    text = without_mark(path.read_bytes())
    lines = re.findall(rb"^mtllib[ \t]+(.+?)\s*$", text, re.MULTILINE)
    names: list[str] = []
    for line in map(text_of, lines):
        several = line.split() if locate(path.parent, line) is None else [line]
        # A name with blanks whose file is missing is not several names.
        names += several if all(map(_is_material, several)) else [line]
    return list(dict.fromkeys(names))


def without_mark(text: bytes) -> bytes:
    """Return a text in UTF-8, without the mark with which programs on Windows begin it."""
    if text.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return text.decode("utf-16", "replace").encode()
    return text.removeprefix(codecs.BOM_UTF8)


def text_of(line: bytes) -> str:
    """Decode a name; programs on Windows write Latin-1, too."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def _is_material(name: str) -> bool:
    return name.lower().endswith(MATERIAL_SUFFIX)


def ply_textures(path: Path) -> list[str]:
    """Return the textures that the header of a PLY file names; the last one counts."""
    with path.open("rb") as file:
        header = file.read(MAX_PLY_HEADER).partition(b"end_header")[0]
    names = re.findall(rb"^comment\s+TextureFile\s+(.+?)\s*$", header, re.MULTILINE | re.IGNORECASE)
    return [text_of(name) for name in names]


class FilesBeside:
    """Reads the files that an OBJ or PLY file names, and says once what is wrong with each."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._said: set[str] = set()

    def text(self, name: str) -> bytes:
        """Return a material file; empty if it is missing, which a warning has said."""
        return without_mark(self._read(f"material file {quoted(name)}", name) or b"")

    def image(self, name: str | None) -> Any:
        """Return a texture, a PIL image; None without a name, or if a warning has said that it has no use."""
        from PIL import Image

        what = f"texture {quoted(name or '')}"
        data = None if name is None else self._read(what, name)
        if data is None:
            return None
        try:
            check_texture(what, data)
        except DigsError as error:
            self._say(f"{error}; drawn without it")
            return None
        return Image.open(BytesIO(data))

    def _read(self, what: str, name: str) -> bytes | None:
        found = locate(self.path.parent, name)
        if found is None:
            self._say(f"{what} is missing; drawn without it")
            return None
        if name.startswith("-"):
            self._say(f"{what}: its options have no effect")
        elif found != self.path.parent / name and found != self.path.parent / unquote(name):
            self._say(f"{what} does not exist; using '{found}'")
        return found.read_bytes()

    def _say(self, sentence: str) -> None:
        if sentence not in self._said:
            self._said.add(sentence)
            logger.warning("mesh '%s': %s", self.path.name, sentence)


def locate(folder: Path, name: str) -> Path | None:
    """Return the file that a mesh file in ``folder`` means by ``name``; None: there is none.

    Tried in this order: the name as it is; URL-decoded, as in glTF; without the options that MTL allows
    before it; with slashes for backslashes; each of these in any case; the last part of it alone.
    """
    words = name.split()
    # Names may have spaces: the longest end of the line that is a file.
    ends = [" ".join(words[n:]) for n in range(1, len(words))] if name.startswith("-") else []
    names = [name, unquote(name), *ends]
    spellings = dict.fromkeys([*names, *(each.replace("\\", "/") for each in names)])
    exact = [folder / spelling for spelling in spellings]
    found = next((path for path in exact if path.is_file()), None)
    loose = (*spellings, *(PurePosixPath(spelling).name for spelling in spellings))
    return found or next(filter(None, (_in_any_case(folder, each) for each in loose)), None)


def _in_any_case(folder: Path, name: str) -> Path | None:
    """Return the file with this relative name, upper and lower case aside."""
    path = folder
    for part in PurePosixPath(name).parts:
        if not (path / part).exists():
            names = sorted(entry.name for entry in path.iterdir()) if path.is_dir() else []
            part = next((each for each in names if each.casefold() == part.casefold()), None)
            if part is None:
                return None
        path = path / part
    return path if path.is_file() else None


class UndecodableError(DigsError):
    """An image file is damaged, or of an unknown kind."""


def check_texture(what: str, data: bytes) -> None:
    """Check that an image file is of a bounded size and can be decoded.

    Args:
        what: names it in the message.
        data: the content of the file.

    Raises:
        UndecodableError: it is damaged.
        DigsError: it is larger than `digs_warp.bounds.TEXTURE`.
    """
    from PIL import Image

    with decoding(what):
        image = Image.open(BytesIO(data))
    TEXTURE.check(what, image.width * image.height)
    with decoding(what):
        image.load()


@contextmanager
def decoding(what: str) -> Iterator[None]:
    """Turn what PIL raises into the errors of `check_texture`; its own bound for pixels is above ours."""
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            yield
    except Image.DecompressionBombError as error:
        raise DigsError(f"{what}: {error}; {TEXTURE.remedy}") from None
    except UnidentifiedImageError:
        raise UndecodableError(f"{what} cannot be decoded (no known kind of image)") from None
    except (OSError, ValueError, SyntaxError, EOFError, IndexError) as error:
        raise UndecodableError(f"{what} cannot be decoded ({error})") from None
