"""Write the named dependencies and the licenses that their packages state into docs/licenses.md.

Usage: python scripts/licenses.py   (in an environment with all extras; others keep their row)
"""

import re
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

from page_marks import DOCS, fill

PAGE = "licenses.md"
UNREAD = "not read: the package was not installed"
ROOT = Path(__file__).resolve().parent.parent

# Packages that state no name, a whole text, or a code that few know.
NAMES = {
    "matplotlib": "PSF-like (Matplotlib license)",
    "scipy": "BSD-3-Clause",
    "trimesh": "MIT",
    "usd-core": "Tomorrow Open Source Technology License 1.0 (TOST-1.0)",
}


def main() -> None:
    """Write the table."""
    old = rows_of((DOCS / PAGE).read_text(encoding="utf-8"))
    rows = []
    for name, extra in named_dependencies().items():
        stated = license_of(name) or old.get(name, UNREAD)
        rows.append(f"| {name} | {f'`[{extra}]`' if extra else 'always'} | {stated} |")
    table = ["| package | needed | license, as the package states it |", "|---|---|---|", *rows]
    sys.stdout.write(f"{fill(PAGE, 'dependencies', chr(10).join(table))}\n")


def named_dependencies() -> dict[str, str]:
    """Return the packages in pyproject.toml with the first extra that names them; "": always needed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = {"": project["dependencies"], **project["optional-dependencies"]}
    found: dict[str, str] = {}
    for extra, requirements in groups.items():
        for requirement in requirements:
            found.setdefault(re.split(r"[\[<>=~! ]", requirement)[0], extra)
    return found


def license_of(package: str) -> str | None:
    """Return what an installed package states; None if it is not installed or states nothing."""
    try:
        stated = metadata(package)
    except PackageNotFoundError:
        return None
    if package in NAMES:
        return NAMES[package]
    for value in (stated[key] for key in ("License-Expression", "License") if key in stated):
        if value and len(value.splitlines()) == 1:
            return value.removesuffix(" License")
    classifiers = [c for c in stated.get_all("Classifier") or [] if c.startswith("License")]
    return classifiers[0].rpartition(" :: ")[2] if classifiers else None


def rows_of(page: str) -> dict[str, str]:
    """Return the license by package in a written page."""
    return dict(re.findall(r"^\| (\S+) \| .* \| (.*) \|$", page, re.MULTILINE))


if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit(__doc__)
    main()
