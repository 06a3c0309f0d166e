"""A new result replaces an old one: whole after a kill at any moment; no file of the user is touched."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.record.files import write_atomically
from digs_warp.record.layout import MANIFEST, REPLACING, RUN_RECORD, UNFINISHED
from digs_warp.record.manifest import Manifest, recorded_files
from digs_warp.record.replacement import (
    check_place,
    finish_replacement,
    our_files,
    replace_result,
)
from digs_warp.record.run_log import RunLog

OLD = ("a.txt", "images/0.png", "images/1.png", "gone/deep/x.txt", "becomes_folder")
NEW = ("a.txt", "images/0.png", "images/2.png", "added/y.txt", "becomes_folder/z.txt")
FOREIGN = ("notes.txt", "images/mine.png", "gone/mine.txt", "empty/.keep")


class Killed(BaseException):
    """Stands for the end of the process."""


def write_result(folder: Path, names: tuple[str, ...], text: str) -> None:
    with recorded_files(folder):
        for name in names:
            write_atomically(folder / name, f"{text} {name}".encode())
        RunLog("run", {"what": text, "capture": str(folder / "capture")}).save(folder / RUN_RECORD)
    inner = folder / "capture"
    with recorded_files(inner):
        write_atomically(inner / "x.png", text.encode())
        RunLog("simulate", {"what": text}).save(inner / RUN_RECORD)


def make(folder: Path) -> Path:
    write_result(folder, OLD, "old")
    for name in FOREIGN:
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_text("precious")
    write_result(folder / UNFINISHED, NEW, "new")
    (folder / UNFINISHED / "database.db").write_text("by a library")
    return folder


def content(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def is_of_old(found: dict[str, bytes]) -> bool:
    return all(found.get(name) == f"old {name}".encode() for name in OLD)


def test_the_new_result_takes_the_place_of_the_old_one(tmp_path: Path) -> None:
    folder = make(tmp_path / "out")
    replace_result(folder)
    found = content(folder)
    texts = {
        name: text for name, text in found.items() if not name.endswith((RUN_RECORD, MANIFEST))
    }
    assert texts == {
        **{name: f"new {name}".encode() for name in NEW},
        **dict.fromkeys(FOREIGN, b"precious"),
        "capture/x.png": b"new",
        "database.db": b"by a library",
    }
    assert b'"old"' not in b"".join(found.values())
    assert UNFINISHED.encode() not in b"".join(found.values())
    assert f'"capture": "{folder}/capture"'.encode() in found[RUN_RECORD]
    assert Manifest.read(folder).all_whole()
    assert "database.db" in Manifest.read(folder).files
    assert our_files(folder) == set(found) - set(FOREIGN)


def test_a_kill_at_any_moment_leaves_a_whole_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", lambda _: None)  # it only takes time
    make(tmp_path / "start")
    whole = tmp_path / "whole"
    shutil.copytree(tmp_path / "start", whole)
    replace_result(whole)
    steps = 0

    def killing(call: Callable[..., Any], at: int) -> Callable[..., Any]:
        def counted(*arguments: Any, **keywords: Any) -> Any:
            nonlocal steps
            steps += 1
            if steps == at:
                raise Killed
            return call(*arguments, **keywords)

        return counted

    at, killed = 0, True
    while killed:
        at, steps, killed = at + 1, 0, False
        folder = tmp_path / "out"
        shutil.copytree(tmp_path / "start", folder)
        with monkeypatch.context() as patched:
            for name in ("replace", "unlink", "rmdir", "mkdir"):
                patched.setattr(os, name, killing(getattr(os, name), at))
            try:
                replace_result(folder)
            except Killed:
                killed = True
        if killed and not (folder / REPLACING).exists():
            found = content(folder)
            if any((folder / UNFINISHED).rglob("*.txt")):
                assert is_of_old(found), at
                replace_result(folder)
        else:
            finish_replacement(folder)
        assert without_paths(content(folder)) == without_paths(content(whole)), at
        shutil.rmtree(folder)
    assert at > 30


def without_paths(found: dict[str, bytes]) -> dict[str, bytes]:
    return {name: data for name, data in found.items() if not name.endswith((RUN_RECORD, MANIFEST))}


@pytest.mark.parametrize(
    ("name", "kind"),
    [("added/y.txt", "file"), ("added", "file"), ("added", "link"), ("a.txt", "changed")],
)
def test_a_file_that_no_run_wrote_is_not_replaced(name: str, kind: str, tmp_path: Path) -> None:
    """Known before the run from the names that it may write; else the new result is kept."""
    folder = make(tmp_path / "out")
    (folder / name).parent.mkdir(exist_ok=True)
    if kind == "link":
        (folder / name).symlink_to(tmp_path)
    else:
        (folder / name).write_text("precious")
    before = content(folder)
    with pytest.raises(DigsError, match=f"{name.replace('.', '[.]')}.*move them away"):
        check_place(folder, ["a.txt", "added/*.txt"])
    assert content(folder) == before
    with pytest.raises(DigsError, match="move them away"):
        replace_result(folder)
    after = content(folder)
    assert all(after[each] == before[each] for each in (*FOREIGN, "images/1.png"))
    assert all(f"{UNFINISHED}/{each}" in after for each in NEW)


def test_foreign_files_that_are_not_in_the_way_are_no_error(tmp_path: Path) -> None:
    check_place(make(tmp_path / "out"), ["a.txt", "images/[0-9]*.png", "added/*.txt"])


def test_files_behind_a_link_are_not_ours(tmp_path: Path) -> None:
    folder = make(tmp_path / "out")
    shutil.move(folder / "images", tmp_path / "elsewhere")
    (folder / "images").symlink_to(tmp_path / "elsewhere")
    assert not any(name.startswith("images") for name in our_files(folder))
    with pytest.raises(DigsError, match="names images"):
        check_place(folder, ["images/*.png"])


def test_a_note_from_elsewhere_deletes_nothing_outside(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("precious")
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    (folder / REPLACING).write_text(
        f'{{"old": ["../precious.txt", "link/precious.txt", "{tmp_path}/precious.txt"], "new": []}}'
    )
    finish_replacement(folder)
    assert (tmp_path / "precious.txt").read_text() == "precious"
