"""The one way to write a file, run.json, and the progress that is shown meanwhile."""

import errno
import json
import logging
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.record import disk, files
from digs_warp.record import progress as module
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.record.progress import progress, show_progress
from digs_warp.record.run_log import RunLog, RunRecord, source_commit
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


@dataclass(frozen=True)
class Settings:
    size: int
    folder: Path
    weights: np.ndarray


def test_json_of_everything_a_run_holds_round_trips(tmp_path: Path) -> None:
    value = {
        "settings": Settings(3, Path("a/b"), np.arange(3)),
        "number": np.float32(0.5),
        "count": np.int64(7),
        "matrix": np.eye(2),
        "flag": np.True_,
    }
    (tmp_path / "x.json").write_text(to_json(value))
    assert read_json(tmp_path / "x.json", "test") == {
        "settings": {"size": 3, "folder": "a/b", "weights": [0, 1, 2]},
        "number": 0.5,
        "count": 7,
        "matrix": [[1, 0], [0, 1]],
        "flag": True,
    }


def test_a_record_of_another_shape_is_named(tmp_path: Path) -> None:
    path, record = tmp_path / "run.json", {"command": "run", "versions": {}, "settings": {}}
    for change in ({"command": 3}, {"versions": []}, {"seconds": {"train": "long"}}):
        path.write_text(json.dumps(record | change))
        with pytest.raises(DigsError, match=r"run\.json'.*run again"):
            RunRecord.load(path)


def test_what_is_not_json_is_refused() -> None:
    for value in (math.nan, -math.inf, np.array([1.0, np.nan]), np.float32("inf")):
        with pytest.raises(DigsError, match=r"finite numbers only.*look for extreme"):
            to_json({"x": [0.0, value]})
    with pytest.raises(TypeError, match="object"):
        to_json({"x": object()})


def test_broken_json_says_where(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text('{\n "a": 1,\n "b": }')
    with pytest.raises(DigsError, match=r"record '.*x\.json': not valid JSON .*line 3"):
        read_json(path, "record")
    with pytest.raises(DigsError, match=r"record '.*gone\.json': no such file"):
        read_json(tmp_path / "gone.json", "record")
    with pytest.raises(DigsError, match=r"record"):
        read_json(tmp_path, "record")


def test_times_of_a_stage_add_up_even_when_it_fails(tmp_path: Path) -> None:
    run = RunLog("test", Settings(1, Path("."), np.zeros(1)))
    with run.stage("a"):
        pass
    first = run.seconds["a"]
    with pytest.raises(ZeroDivisionError), run.stage("a"):
        raise ZeroDivisionError
    with run.stage("b"):
        pass
    assert run.seconds["a"] > first >= 0
    assert list(run.seconds) == ["a", "b"]

    run.results["psnr"] = np.float64(33.5)
    run.save(tmp_path / "run.json")
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["results"] == {"psnr": 33.5}
    assert record["settings"]["size"] == 1
    assert {"python", "numpy", "warp-lang", "digs-warp"} <= set(record["versions"])
    assert record["machine"]["cores"] >= 1


def test_a_run_with_other_settings_is_not_continued(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    settings = {"size": 1, "same": 3, "train": {"seed": 0, "old": 2}}
    RunLog("run", settings, seconds={"a": 5.0}).save(path)
    same = RunLog("run", settings, seconds={})
    same.continue_from(tmp_path / "none.json")
    assert same.seconds == {}
    same.continue_from(path)
    assert same.seconds == {"a": 5.0}
    run = RunLog("run", {"size": 1, "same": 3, "train": {"seed": 1}, "new": "x"})
    with pytest.raises(DigsError, match=r"\(seed 0 -> 1, old 2 -> None, new None -> x\)"):
        run.continue_from(path)
    assert run.seconds == {}


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git to make a repository")
def test_the_commit_is_that_of_the_checkout(tmp_path: Path) -> None:
    (tmp_path / "a/package").mkdir(parents=True)
    assert source_commit(tmp_path / "a/package") is None
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-b", "main"], ["commit", "--allow-empty", "-m", "first"]):
        subprocess.run([*git, *command], check=True, capture_output=True)
    found = source_commit(tmp_path / "package")
    assert found is not None and len(found) == 40


@pytest.fixture
def shown() -> Iterator[None]:
    show_progress()
    yield
    show_progress(False)


def count_to_three(label: str) -> None:
    with progress(3, label, "frame") as bar:
        for _ in range(3):
            bar.update()


def test_a_terminal_shows_bars_where_progress_is_on(capsys, monkeypatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    for shown, disable, has_bars in (
        (False, None, False),
        (True, None, True),
        *((True, value, False) for value in ("1", "true")),
        *((True, value, True) for value in ("0", "")),
    ):
        show_progress(shown)
        if disable is not None:
            monkeypatch.setenv("TQDM_DISABLE", disable)
        count_to_three("bar")
        assert ("bar: 100%" in capsys.readouterr().err) == has_bars, disable


@pytest.mark.usefixtures("shown")
def test_a_log_has_no_bars_but_a_line_every_half_minute_with_an_estimate(
    capsys, caplog, monkeypatch
) -> None:
    caplog.set_level(logging.INFO)
    count_to_three("short")
    assert capsys.readouterr().err == "" and caplog.records == []
    now = 0.0
    monkeypatch.setattr(module.time, "monotonic", lambda: now)
    with progress(200, "Training", initial=100) as bar:
        for step in range(100):
            bar.set_postfix_str(f"loss {step}")
            now += 1.0
            bar.update()
    assert [record.message for record in caplog.records] == [
        "Training: 130 of 200 steps, about 70 s left, loss 29",
        "Training: 160 of 200 steps, about 40 s left, loss 59",
        "Training: 190 of 200 steps, about 10 s left, loss 89",
    ]


@pytest.mark.usefixtures("shown")
def test_every_stage_says_that_it_begins_in_one_line(capsys, caplog) -> None:
    caplog.set_level(logging.INFO)
    whole, part = RunLog("run", None), RunLog("reconstruct", None)
    with whole.stage("reconstruct"), part.stage("train"):
        pass
    with whole.stage("report"):
        pass
    lines = [record.message for record in caplog.records]
    assert [line.split(" s  ")[1] for line in lines] == ["reconstruct", "  train", "report"]
    assert all(0.0 <= float(line.split()[0]) < 60 for line in lines)
    show_progress(False)
    with whole.stage("export"):
        pass
    assert len(caplog.records) == 3
    assert "\r" not in capsys.readouterr().err
