"""The one way to write a file: whole and under its name, or an error and the old file."""

import errno
import os
from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.record import disk, files
from digs_warp.record.files import write_atomically
from reference.full_disk import largest_file, small_disk


def test_a_write_replaces_the_whole_file_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "new" / "x.bin"
    for data in (b"a long first version", b"short"):
        write_atomically(path, data)
        assert path.read_bytes() == data
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize(("code", "says"), [(errno.EIO, "Free space"), (errno.EROFS, "unchanged")])
def test_a_failed_write_keeps_the_old_file(
    tmp_path: Path, monkeypatch, code: int, says: str
) -> None:
    path = tmp_path / "x.bin"
    write_atomically(path, b"old")

    def refuse(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(disk.os, "fsync", refuse)
    with pytest.raises(
        DigsError, match=rf"x\.bin': cannot be written \({os.strerror(code)}.*{says}"
    ):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_told_with_path_space_needed_and_space_free(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 8 * 4096) as folder:
        write_atomically(folder / "a.bin", b"old")
        with pytest.raises(DigsError, match=r"a\.bin.*needs 1\.0 MB, 2[48]\.. kB free.*--resume"):
            write_atomically(folder / "a.bin", bytes(10**6))
        assert (folder / "a.bin").read_bytes() == b"old"
        assert list(folder.iterdir()) == [folder / "a.bin"]


def test_room_is_checked_for_libraries_that_crash_without(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 8 * 4096) as folder:
        disk.check_room(folder / "a.db", 8 * 4096)
        with pytest.raises(DigsError, match=r"a\.db.*needs 1\.0 MB"):
            disk.check_room(folder / "a.db", 10**6)
        assert list(folder.iterdir()) == []


def test_half_a_line_that_a_kill_left_is_cut_off(tmp_path: Path) -> None:
    for before, kept in ((b"one\ntw", b"one\n"), (b"on", b""), (b"one\n", b"one\n")):
        (tmp_path / "x.jsonl").write_bytes(before)
        files.add_line(tmp_path / "x.jsonl", "new")
        assert (tmp_path / "x.jsonl").read_bytes() == kept + b"new\n"


def test_a_library_that_writes_by_name_gets_a_name_beside_the_target(tmp_path: Path) -> None:
    path = tmp_path / "new" / "x.bin"
    with files.new_file(path) as unfinished:
        assert unfinished.name == "x.bin" and not path.exists()
        unfinished.write_bytes(b"first")
        (unfinished.parent / "scratch").write_bytes(b"more")
    assert path.read_bytes() == b"first"
    with pytest.raises(ZeroDivisionError), files.new_file(path) as unfinished:
        unfinished.write_bytes(b"half")
        raise ZeroDivisionError
    with largest_file(100), pytest.raises(DigsError, match=r"x\.bin': cannot be written .*Free sp"):
        with files.new_file(path) as unfinished:
            unfinished.write_bytes(bytes(101))
    assert path.read_bytes() == b"first"
    assert list(path.parent.iterdir()) == [path]
