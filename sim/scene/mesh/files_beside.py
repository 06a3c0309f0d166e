"""The files that a mesh file names: materials and textures, found by names that other systems wrote.

trimesh leaves out what it cannot find or read, without a word. Windows does not care about upper and lower
case or which way slashes lean, so names that worked there need not work here.
"""

import codecs
import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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


def resolver_beside(path: Path) -> Any:
    """Return the `trimesh.resolvers.Resolver` of a mesh file.

    It logs a warning for a file that is missing, for a name that must mean a file with another name, and, of
    OBJ and PLY files, for a texture that is too large or cannot be decoded. The mesh is drawn without it.
    """
    from trimesh.resolvers import FilePathResolver

    files = _FilesBeside(path)

    class Beside(FilePathResolver):
        def get(self, name: str) -> bytes:
            return files.read(name.strip())

    # Textures often lie in a folder next to that of the mesh. trimesh names parts after the file, whose own
    # name may be no text.
    return Beside(str(path.with_name("mesh")), allow_anywhere=True)


def obj_materials(path: Path) -> list[str]:
    """Return the material files that an OBJ file names: one a line, or several with blanks between them."""
    text = without_mark(path.read_bytes())
    lines = re.findall(rb"^mtllib[ \t]+(.+?)\s*$", text, re.MULTILINE)
    names: list[str] = []
    for line in map(_text, lines):
        several = line.split() if locate(path.parent, line) is None else [line]
        # A name with blanks whose file is missing is not several names.
        names += several if all(map(_is_material, several)) else [line]
    return list(dict.fromkeys(names))


def opacity_maps(path: Path) -> dict[str, Any]:
    """Return what ``map_d`` names, which trimesh leaves out: PIL images, by name of the material.

    Args:
        path: of an OBJ file.
    """
    from PIL import Image

    files, found = _FilesBeside(path), {}
    for name in obj_materials(path):
        place = locate(path.parent, name)
        material = ""
        for line in without_mark(place.read_bytes()).splitlines() if place else ():
            key, _, value = _text(line).strip().partition(" ")
            if key == "newmtl":
                material = " ".join(value.split())
            elif key == "map_d":
                with suppress(OSError, DigsError):  # a warning has said it
                    found[material] = Image.open(BytesIO(files.read(value.strip())))
    return found


def without_mark(text: bytes) -> bytes:
    """Return a text in UTF-8, without the mark with which programs on Windows begin it."""
    if text.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return text.decode("utf-16", "replace").encode()
    return text.removeprefix(codecs.BOM_UTF8)


def _text(line: bytes) -> str:
    """Decode a name; programs on Windows write Latin-1, too."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def _is_material(name: str) -> bool:
    return name.lower().endswith(MATERIAL_SUFFIX)


def ply_textures(path: Path) -> list[str]:
    """Return the textures that the header of a PLY file names; trimesh uses the last one."""
    with path.open("rb") as file:
        header = file.read(MAX_PLY_HEADER).partition(b"end_header")[0]
    names = re.findall(rb"^comment\s+TextureFile\s+(.+?)\s*$", header, re.MULTILINE | re.IGNORECASE)
    return [_text(name) for name in names]


class _FilesBeside:
    """Reads the files that the mesh file ``path`` names, and says once what is wrong with each."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._said: set[str] = set()

    def read(self, name: str) -> bytes:
        """Return the content of a file; for the first material file of an OBJ file, that of all.

        Raises:
            OSError, DigsError: it is missing or no usable texture, which a warning has said.
        """
        if self.path.suffix.lower() == ".obj" and _is_material(name):
            return self._all_materials()
        return self._read(name)

    def _all_materials(self) -> bytes:
        """Return the material files that are there, one after the other: trimesh asks for one alone."""
        contents = []
        for name in obj_materials(self.path):
            with suppress(FileNotFoundError):
                contents.append(self._read(name))
        return b"\n".join(contents)

    def _read(self, name: str) -> bytes:
        is_material = _is_material(name)
        what = f"{'material file' if is_material else 'texture'} {quoted(name)}"
        found = locate(self.path.parent, name)
        if found is None:
            self._say(f"{what} is missing; drawn without it")
            raise FileNotFoundError(name)
        if name.startswith("-"):
            self._say(f"{what}: its options have no effect")
        elif found != self.path.parent / name and found != self.path.parent / unquote(name):
            self._say(f"{what} does not exist; using '{found}'")
        data = found.read_bytes()
        if is_material:
            return without_mark(data)
        if self.path.suffix.lower() in (".obj", ".ply"):
            try:
                check_texture(what, data)
            except DigsError as error:
                self._say(f"{error}; drawn without it")
                raise
        return data

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


def check_texture(what: str, data: bytes, decode: bool = True) -> None:
    """Check that an image file is of a bounded size and can be decoded.

    Args:
        what: names it in the message.
        data: the content of the file.
        decode: whether to decode all of it, not only its header.

    Raises:
        UndecodableError: it is damaged.
        DigsError: it is larger than `digs_warp.bounds.TEXTURE`.
    """
    from PIL import Image

    with decoding(what):
        image = Image.open(BytesIO(data))
    TEXTURE.check(what, image.width * image.height)
    if decode:
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
