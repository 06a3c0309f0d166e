"""Where a page of the documentation keeps what a command measures: between two comments.

<!-- NAME: written by scripts/SCRIPT.py -->
<!-- end -->
"""

import re
from pathlib import Path

from digs_warp.record.files import write_atomically

DOCS = Path(__file__).resolve().parent.parent / "docs"


def fill(page: str, name: str, text: str) -> Path:
    """Put ``text`` between the marks ``name`` of a page and return where the page lies.

    Raises:
        ValueError: the page has no such marks, or several.
    """
    path = DOCS / page
    marks = rf"(<!-- {name}: [^>]*-->\n).*?(<!-- end -->)"
    filled, count = re.subn(
        marks,
        lambda found: f"{found[1]}{text.strip()}\n{found[2]}",
        path.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    if count != 1:
        raise ValueError(f"'{path}': {count} places for {name}, expected 1")
    write_atomically(path, filled.encode())
    return path
