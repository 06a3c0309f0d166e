"""The manifest lists what was written, also after a kill, and tells what is missing."""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from digs_warp.record.files import copy_file, new_file, remove, write_atomically
from digs_warp.record.manifest import Manifest, is_kept, recorded_files
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


def test_missing_files_are_named_and_those_of_others_not_kept(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
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
