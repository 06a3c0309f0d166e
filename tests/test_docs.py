"""The documents stay true: files they name exist, commands they show parse, code they show runs."""

import re
import shlex
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import digs_warp
from digs_warp import cli
from digs_warp.commands.command import COMMANDS, Group
from digs_warp.data.capture import read_capture

REPOSITORY = Path(__file__).resolve().parent.parent
DOCUMENTS = sorted([*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")])
CODE_FOLDERS = (
    "digs_warp",
    "sim",
    "usd",
    "tests",
    "docs",
    "scripts",
    "studies",
    "examples",
    r"\.ci",
)


def blocks(document: Path, language: str) -> list[str]:
    """The fenced blocks of a language."""
    pattern = rf"^```{language}\n(.*?)^```$"
    return re.findall(pattern, document.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def shell_lines(document: Path, program: str) -> list[list[str]]:
    """The command lines in a document that start with ``program``, without it."""
    lines = "\n".join(blocks(document, "sh")).replace("\\\n", " ").splitlines()
    words = [shlex.split(line, comments=True) for line in lines]
    return [line[1:] for line in words if line and line[0] == program]


def lost_links(document: Path) -> Iterable[str]:
    targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", document.read_text(encoding="utf-8"))
    return (t for t in targets if "://" not in t and not (document.parent / t).exists())


def lost_files(document: Path) -> Iterable[str]:
    text = document.read_text(encoding="utf-8")
    spans = re.findall(r"`([^`\n]+)`", text)
    named = [s for s in spans if re.match(rf"({'|'.join(CODE_FOLDERS)})/[\w./-]*$", s)]
    named += re.findall(rf"\b((?:{'|'.join(CODE_FOLDERS)})/[\w/]*\w\.\w+)", text)
    return (name for name in named if not (REPOSITORY / name).exists())


def lost_tests(document: Path) -> Iterable[str]:
    spans = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", document.read_text(encoding="utf-8"))
    for path, name in spans:
        if f"def {name}(" not in (REPOSITORY / path).read_text(encoding="utf-8"):
            yield f"{path}::{name}"


def refused_command_lines(document: Path) -> Iterable[str]:
    for arguments in shell_lines(document, "digs-warp"):
        if arguments[0].startswith("--tyro-"):  # writes a file
            continue
        if "--config" in arguments:  # a file that an earlier line writes
            place = arguments.index("--config")
            del arguments[place : place + 2]
        try:
            cli.parse(arguments)
        except SystemExit as stop:
            if "--help" not in arguments[-1] or stop.code != 0:
                yield " ".join(arguments)


def lost_commands(document: Path) -> Iterable[str]:
    named = re.findall(r"`digs-warp ([a-z][a-z-]*)", document.read_text(encoding="utf-8"))
    return set(named) - COMMANDS.members.keys()


def lost_make_targets(document: Path) -> Iterable[str]:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    shown = {line[0] for line in shell_lines(document, "make") if line}
    named = re.findall(r"`make ([a-z-]+)", document.read_text(encoding="utf-8"))
    return (shown | set(named)) - set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))


def lost_in_documents(lost: Callable[[Path], Iterable[str]]) -> dict[str, list[str]]:
    """What a rule finds wrong, by document."""
    found = {str(path.relative_to(REPOSITORY)): list(lost(path)) for path in DOCUMENTS}
    return {name: lost for name, lost in found.items() if lost}


NAMED = (
    lost_links,
    lost_files,
    lost_tests,
    refused_command_lines,
    lost_commands,
    lost_make_targets,
)


@pytest.mark.parametrize("lost", NAMED)
def test_what_documents_name_is_there(lost: Callable[[Path], Iterable[str]]) -> None:
    assert lost_in_documents(lost) == {}


def test_the_navigation_of_the_site_has_every_page() -> None:
    site = (REPOSITORY / "zensical.toml").read_text(encoding="utf-8")
    pages = {
        str(page.relative_to(REPOSITORY / "docs")) for page in (REPOSITORY / "docs").rglob("*.md")
    }
    assert set(re.findall(r'"([\w/-]+\.md)"', site)) == pages


def every_flag(group: Group, capsys: pytest.CaptureFixture[str], *words: str) -> set[str]:
    """The flags of all commands of a group."""
    found: set[str] = set()
    for name, member in group.members.items():
        if isinstance(member, Group):
            found |= every_flag(member, capsys, *words, name)
        else:
            with suppress(SystemExit):
                cli.main([*words, name, "--help-all"])
            found |= set(re.findall(r"--[a-z][a-z-]*", capsys.readouterr().out))
    return found


def test_named_flags_exist(capsys: pytest.CaptureFixture[str]) -> None:
    flags = every_flag(COMMANDS, capsys) | {"--version"}
    flags |= {"--cpus-per-task", "--mem", "--time", "--eval"}  # of Slurm, of 3D Gaussian splatting

    def lost(document: Path) -> Iterable[str]:
        text = document.read_text(encoding="utf-8")
        is_history = document.parent.name == "research"
        return () if is_history else set(re.findall(r"`(--[a-z][a-z-]*)", text)) - flags

    assert lost_in_documents(lost) == {}


def test_the_readme_shows_every_command() -> None:
    shown = {arguments[0] for arguments in shell_lines(REPOSITORY / "README.md", "digs-warp")}
    assert shown == COMMANDS.members.keys()


def test_the_readme_maps_every_room() -> None:
    folders = {
        str(path.parent.relative_to(REPOSITORY)) + "/"
        for package in ("digs_warp", "sim")
        for path in (REPOSITORY / package).glob("*/__init__.py")
        if not path.parent.is_symlink()
    }
    mapped = re.findall(r"^\| `([^`]+)` \|", (REPOSITORY / "README.md").read_text(), re.MULTILINE)
    assert folders <= set(mapped)
    assert len(mapped) == len(set(mapped))


def test_the_examples_of_the_api_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = REPOSITORY / "docs" / "api.md"
    names: dict[str, Any] = {}
    for example in blocks(page, "python"):
        exec(compile(example, str(page), "exec"), names)
    assert names["gradients"].means.any() and len(names["result"].gaussians)


def test_the_api_page_names_everything_that_is_public() -> None:
    page = (REPOSITORY / "docs" / "api.md").read_text(encoding="utf-8")
    words = set(re.findall(r"\w+", page))
    assert set(digs_warp.__all__) <= words


def test_the_example_of_the_capture_format_writes_what_the_page_describes(tmp_path: Path) -> None:
    page = REPOSITORY / "docs" / "formats.md"
    (example,) = blocks(page, "python")
    folder = tmp_path / "capture"
    exec(compile(example, str(page), "exec"), {"folder": folder})
    capture = read_capture(folder)
    assert len(capture) == 3
    assert capture.frames[1].load_depth()[0, 0] == pytest.approx(0.8)
    described = set(re.findall(r"`(\w+)`", page.read_text(encoding="utf-8")))
    written = set(re.findall(r'"(\w+)":', (folder / "transforms.json").read_text()))
    assert written <= described
