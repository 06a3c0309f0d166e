"""A new result replaces an old one: whole after a kill at any moment; no file of the user is touched."""

import os
import shutil
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.record.files import write_atomically
from digs_warp.record.layout import MANIFEST, RUN_RECORD, UNFINISHED
from digs_warp.record.manifest import Manifest, recorded_files
from digs_warp.record.replacement import our_files, replace_result
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
    assert "database.db" in Manifest.read(folder).names
    assert our_files(folder) == set(found) - set(FOREIGN)


def test_a_kill_at_any_moment_never_mixes_two_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the run that is made again afterwards leaves the whole one."""
    monkeypatch.setattr(os, "fsync", lambda _: None)  # it only takes time
    make(tmp_path / "start")
    folder, at, killed = tmp_path / "out", 0, True
    while killed:
        at, steps, killed = at + 1, count(1), False
        shutil.copytree(tmp_path / "start", folder)
        with monkeypatch.context() as patched:
            for name in ("replace", "unlink", "rmdir", "mkdir"):
                patched.setattr(os, name, killing(getattr(os, name), at, steps))
            try:
                replace_result(folder)
            except Killed:
                killed = True
        texts = {content(folder).get(name, b"")[:3] for name in (*OLD, *NEW)}
        assert not {b"old", b"new"} <= texts, at
        if killed:
            write_result(folder / UNFINISHED, NEW, "new")
            replace_result(folder)
        found = content(folder)
        assert all(found[name] == f"new {name}".encode() for name in NEW)
        assert all(found[name] == b"precious" for name in FOREIGN)
        assert not any(name in found for name in {*OLD} - {*NEW})
        shutil.rmtree(folder)
    assert at > 20


def killing(call: Callable[..., Any], at: int, steps: Iterator[int]) -> Callable[..., Any]:
    def counted(*arguments: Any, **keywords: Any) -> Any:
        if next(steps) == at:
            raise Killed
        return call(*arguments, **keywords)

    return counted


@pytest.mark.parametrize("name", ["added/y.txt", "added/y.txt/mine", "added", "link"])
def test_a_file_that_no_run_wrote_is_not_replaced(name: str, tmp_path: Path) -> None:
    """The new result is kept where it was made."""
    folder = make(tmp_path / "out")
    if name == "link":
        (folder / "added").symlink_to(tmp_path)
    else:
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_text("precious")
    before = content(folder)
    with pytest.raises(DigsError, match=r"needs the names added.*move them away"):
        replace_result(folder)
    after = content(folder)
    assert all(after[each] == before[each] for each in (*FOREIGN, "images/1.png"))
    assert all(f"{UNFINISHED}/{each}" in after for each in NEW)


def test_files_behind_a_link_are_not_ours(tmp_path: Path) -> None:
    folder = make(tmp_path / "out")
    shutil.move(folder / "images", tmp_path / "elsewhere")
    (folder / "images").symlink_to(tmp_path / "elsewhere")
    (folder / "a.txt").unlink()
    (folder / "a.txt").symlink_to(tmp_path / "elsewhere")
    assert not any(name.startswith(("images", "a.txt")) for name in our_files(folder))
    with pytest.raises(DigsError, match=r"names a\.txt, images"):
        replace_result(folder)
