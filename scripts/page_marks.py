"""Places in the pages of the documentation that scripts fill: between two comments.

<!-- NAME: written by scripts/SCRIPT.py -->
<!-- end -->
"""

import re
from pathlib import Path

from digs_warp.record.files import write_atomically

DOCS = Path(__file__).resolve().parent.parent / "docs"


def marks(page: str) -> list[str]:
    """Return the names of the marks of a page, in their order."""
    return re.findall(r"<!-- ([^:>]+): written by", (DOCS / page).read_text(encoding="utf-8"))


def fill(page: str, name: str, text: str) -> Path:
    """Put ``text`` between the marks ``name`` of a page and return the path of the page.

    Raises:
        ValueError: the page has no such marks, or several.
    """
    path = DOCS / page
    place = rf"(<!-- {name}: [^>]*-->\n).*?(<!-- end -->)"
    filled, count = re.subn(
        place,
        lambda found: f"{found[1]}{text.strip()}\n{found[2]}",
        path.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    if count != 1:
        raise ValueError(f"'{path}': {count} places for {name}, expected 1")
    write_atomically(path, filled.encode())
    return path
