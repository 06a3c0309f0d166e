"""The list of what runs wrote, and how a new result replaces an old one: whole after a kill at any moment."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.record.files import copy_file, new_file, remove, write_atomically
from digs_warp.record.layout import MANIFEST, RUN_RECORD, UNFINISHED
from digs_warp.record.manifest import Manifest, is_kept, recorded_files
from digs_warp.record.replacement import our_files, replace_result
from digs_warp.record.run_log import RunLog
from reference.file_hashes import file_hashes


def test_it_lists_what_is_written_below_its_folder_by_any_thread(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    with recorded_files(folder), ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda n: write_atomically(folder / f"a/{n}.bin", bytes([n])), range(50)))
        with new_file(folder / "named.bin") as unfinished:
            unfinished.write_bytes(b"named")
        copy_file(folder / "named.bin", folder / "copy.bin")
        write_atomically(folder / "gone.bin", b"")
        remove(folder / "gone.bin")
        write_atomically(tmp_path / "outside.bin", b"")
        write_atomically(folder / "run.json", b"{}")
    lines = (folder / "files.jsonl").read_text().splitlines()
    assert [json.loads(line)["path"] for line in lines] == sorted(file_hashes(folder))
    assert len(lines) == 52


def test_a_folder_within_a_recorded_one_has_its_own(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path)
    with recorded_files(tmp_path / "link"), recorded_files(tmp_path / "inner"):
        write_atomically(tmp_path / "link/a.bin", b"a")
        write_atomically(tmp_path / "inner/b.bin", b"b")
    assert Manifest.read(tmp_path).names == {"a.bin"}
    assert Manifest.read(tmp_path / "inner").names == {"b.bin"}


def test_missing_files_are_named_and_those_of_others_not_kept(tmp_path: Path, caplog) -> None:
    with recorded_files(tmp_path):
        for name in ("good", "gone", "removed"):
            write_atomically(tmp_path / name, name.encode())
        remove(tmp_path / "removed")
    assert Manifest.read(tmp_path).is_complete()
    (tmp_path / "gone").unlink()
    (tmp_path / "users").write_bytes(b"not ours")
    assert not Manifest.read(tmp_path).is_complete()
    with recorded_files(tmp_path, resume=True) as manifest:
        assert manifest.drop_missing() == ["gone"]
        assert is_kept(tmp_path / "good") and not is_kept(tmp_path / "users")
    assert "1 file is missing and made again: gone" in caplog.text
    assert Manifest.read(tmp_path).is_complete() and not Manifest.read(tmp_path / "x").is_complete()


KILLED = """
import os, sys
from pathlib import Path
from digs_warp.record import disk, files, manifest
folder = Path(sys.argv[1])
replace = os.replace
with manifest.recorded_files(folder):
    files.write_atomically(folder / "a", b"first")
    files.write_atomically(folder / "b", b"whole")
    files.remove(folder / "b")
    def killed(*paths):
        if sys.argv[2] == "after":
            replace(*paths)
        os._exit(9)
    os.replace = killed
    files.write_atomically(folder / "a", b"second")
"""


@pytest.mark.parametrize(("when", "content"), [("before", b"first"), ("after", b"second")])
def test_a_kill_in_the_middle_of_a_write_leaves_a_whole_file_that_is_listed(
    tmp_path: Path, when: str, content: bytes
) -> None:
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), when], check=False)
    assert done.returncode == 9 and (tmp_path / "a").read_bytes() == content
    with (tmp_path / "files.jsonl").open("a") as file:
        file.write('{"path": "torn", "go')
    assert Manifest.read(tmp_path).is_complete()
    with recorded_files(tmp_path, resume=True):
        write_atomically(tmp_path / "c", b"")
    assert Manifest.read(tmp_path).names == {"a", "c"}


def test_lines_of_others_lead_nowhere(tmp_path: Path) -> None:
    lines = ["[]", "7", "\x00", '{"path": 3}', '{"path": "../victim"}', '{"path": "/etc/passwd"}']
    (tmp_path / "files.jsonl").write_text("\n".join(lines))
    assert Manifest.read(tmp_path).names == set()


def test_a_folder_that_was_moved_to_another_disk_and_linked_is_still_whole(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    with recorded_files(folder):
        write_atomically(folder / "images" / "a.bin", b"a")
    (folder / "images").rename(tmp_path / "elsewhere")
    (folder / "images").symlink_to(tmp_path / "elsewhere")
    with recorded_files(folder, resume=True) as manifest:
        assert manifest.drop_missing() == [] and is_kept(folder / "images" / "a.bin")
        (folder / "images" / "a.bin").unlink()
        assert manifest.drop_missing() == ["images/a.bin"]


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


def test_a_kill_at_any_moment_never_mixes_two_results(tmp_path: Path, monkeypatch) -> None:
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
