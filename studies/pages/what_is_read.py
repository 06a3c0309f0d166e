"""The tables of docs/what-is-read.md: what becomes of what each format holds, as the readers have it."""

from collections.abc import Iterable, Iterator

from digs_warp.formats.table import DEPTH_IMAGES, FILMS, RECORDINGS, REFUSED_IMAGES, Form
from digs_warp.study.table import Table
from scripts.page_marks import fill

PAGE = "what-is-read.md"


def main() -> None:
    """Fill the page."""
    for mark, text in texts().items():
        fill(PAGE, mark, text)


def texts() -> dict[str, str]:
    """Return the tables by mark."""
    images = Form("images", DEPTH_IMAGES, refuses=REFUSED_IMAGES)
    return {
        "images": _table([images]),
        "recordings": _table([*RECORDINGS.values(), *FILMS]),
    }


def _table(forms: Iterable[Form]) -> str:
    several = [row for form in forms for row in _rows(form)]
    return Table("forms", ["format", "what", "becomes"], several).markdown()


def _rows(form: Form) -> Iterator[list[str]]:
    name = f"`{form.name}`"
    for what, becomes in form.reads.items():
        yield [name, _what(what), f"read: {becomes}"]
        name = ""
    for what, words in form.leaves.items():
        yield [name, _what(what), f"left out, and said: {words}"]
    for what, cure in form.refuses.items():
        yield [name, what, f"**refused**: {cure}"]


def _what(what: str) -> str:
    """Return a path as code, words as they are."""
    return (
        what
        if " " in what or ("." not in what and "/" not in what and "*" not in what)
        else f"`{what}`"
    )
