"""Build a version, try it as a user would, and write its notes: nothing is uploaded or tagged.

Usage: python scripts/release.py   (`make release`)

From the last commit, into dist/: the source package, the wheel that is built from it, and notes-VERSION.md
(its section of CHANGELOG.md). In between, the wheel is installed with all its dependencies into a
fresh environment, which makes a small recording into a USD scene and validates it.
"""

import re
import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.record.files import copy_folder, write_atomically

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build/release"
DIST = ROOT / "dist"
UNRELEASED = "Unreleased"

# The main job, as small as it still makes sense.
TRIAL = "run --out out --frames 12 --width 160 --height 90 --iterations 50"


def main() -> int:
    """Make the release; return the exit code."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "version"
    ]
    try:
        title, notes = notes_of((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), version)
        require_clean(ROOT)
        shutil.rmtree(BUILD, ignore_errors=True)
        built = build(cloned())
        try_out(next(each for each in built if each.suffix == ".whl"), version)
    except DigsError as error:
        sys.stderr.write(f"release: {error}\n")
        return 2
    except subprocess.CalledProcessError as error:
        sys.stderr.write(f"release: exit code {error.returncode} of: {' '.join(error.cmd)}\n")
        return 1
    made = BUILD / "dist"
    write_atomically(made / f"notes-{version}.md", notes.encode())
    shutil.rmtree(DIST, ignore_errors=True)
    copy_folder(made, DIST)
    say(f"{version} is in '{DIST}'; its notes are the section [{title}] of CHANGELOG.md")
    return 0


def notes_of(changelog: str, version: str) -> tuple[str, str]:
    """Return title and text of the section of a version; before it has one, that of [Unreleased].

    Raises:
        DigsError: there is neither, or it is empty.
    """
    sections = {
        title: text.strip() + "\n"
        for title, text in re.findall(
            r"^## \[([^\]]+)\][^\n]*\n(.*?)(?=^## \[|\Z)", changelog, re.MULTILINE | re.DOTALL
        )
    }
    for title in (version, UNRELEASED):
        if sections.get(title, "").strip():
            return title, sections[title]
    raise DigsError(
        f"CHANGELOG.md has no text under '## [{version}]' or '## [{UNRELEASED}]'; say there what changed"
    )


def require_clean(repository: Path) -> None:
    """Raise a `DigsError` if files differ from the last commit: they would not be released."""
    changed = git(repository, "status", "--porcelain").splitlines()
    if changed:
        raise DigsError(
            f"'{changed[0][3:]}' is not as in the last commit; commit it or put it back"
        )


def cloned() -> Path:
    """Return a clone of the last commit: ignored files must not get into the packages."""
    git(ROOT, "clone", "--quiet", "--no-hardlinks", str(ROOT), str(BUILD / "source"))
    return BUILD / "source"


def build(source: Path) -> list[Path]:
    """Return the source package and the wheel that is built from it, both looked through."""
    tools = environment(BUILD / "tools", "build", "twine")
    run(tools / "python", "-m", "build", "--outdir", BUILD / "dist", source)
    built = sorted((BUILD / "dist").iterdir())
    run(tools / "twine", "check", "--strict", *built)
    return built


def try_out(wheel: Path, version: str) -> None:
    """Install the wheel with its dependencies and use it far from this checkout.

    Raises:
        DigsError: it says that it is another version.
    """
    say("Installing the wheel with its dependencies (some minutes)")
    place = environment(BUILD / "trial", "--constraint", ROOT / "constraints.txt", wheel)
    folder = BUILD / "empty"
    folder.mkdir()
    command = place / "digs-warp"
    said = subprocess.run(
        [command, "--version"], cwd=folder, check=True, capture_output=True, text=True
    ).stdout.strip()
    if version not in said.split():
        raise DigsError(f"the installed command says '{said}', expected {version}")
    run(command, *TRIAL.split(), cwd=folder)
    run(command, "usd", "validate", "out/scene.usdz", cwd=folder)


def environment(folder: Path, *requirements: str | Path) -> Path:
    """Make an environment, install into it, and return the folder of its programs."""
    venv.create(folder, with_pip=True)
    pip = [folder / "bin/python", "-m", "pip", "install", "--disable-pip-version-check", "--quiet"]
    run(*pip, *requirements)
    return folder / "bin"


def run(*command: str | Path, cwd: Path | None = None) -> None:
    """Run a program; its output goes where this one's goes."""
    subprocess.run([*map(str, command)], cwd=cwd, check=True)


def git(repository: Path, *words: str) -> str:
    """Return what git says about a repository."""
    command = ["git", "-C", str(repository), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def say(line: str) -> None:
    """Print a line."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
