"""Commands on a disk that runs full: a clear error, no truncated file; with room, the same result."""

import json
import re
import zipfile
from pathlib import Path

import pytest

from digs_warp import cli
from digs_warp.record.layout import MANIFEST, RUN_RECORD
from reference.full_disk import largest_file

SIMULATE = "simulate --frames 4 --width 64 --samples-per-pixel 1 --ground none"
COMMANDS = (
    f"{SIMULATE} --out OUT/a --resume",
    "reconstruct IN/capture --iterations 12 --test-every 3 --masks depth --out OUT/a --resume",
    "render IN/result --seconds 0.4 --width 256 --height 144 --out OUT/film.mp4",
    "convert IN/result --out OUT/scene.spz",
    "convert IN/capture --to colmap --out OUT/a",
    "export-usd IN/result --capture IN/capture --out OUT/scene.usdz",
)
SHARES = (0.0, 0.4, 0.9)  # of the largest file of the result


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    for command in (
        f"{SIMULATE} --out IN/capture",
        "reconstruct IN/capture --iterations 12 --test-every 3 --masks depth --out IN/result",
    ):
        assert cli.main(command.replace("IN", str(folder)).split()) == 0
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """The files below ``folder``, without what differs between any two runs."""
    found = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        content = path.read_bytes()
        if path.name == MANIFEST:
            listed = {json.loads(line)["path"] for line in content.splitlines() if line}
            content = json.dumps(sorted(listed)).encode()
        elif path.name == RUN_RECORD:
            content = b""  # times of day
        elif path.suffix in (".jsonl", ".json"):
            content = re.sub(rb'"(training_)?seconds": [0-9.e-]+', b"", content)
        found[path.relative_to(folder).as_posix()] = content
    return found


def is_whole(path: Path, content: bytes, expected: bytes | None) -> bool:
    """Whether a file is that of an undisturbed run, or a complete earlier version of it."""
    if content == expected or path.name in (RUN_RECORD, MANIFEST) or path.name.startswith("."):
        return True
    if path.suffix == ".json":
        return bool(json.loads(content))  # half an object is no JSON
    if path.suffix == ".npz":  # a checkpoint of an earlier step
        return zipfile.ZipFile(path).testzip() is None
    return False


@pytest.mark.parametrize("command", COMMANDS, ids=lambda text: " ".join(text.split()[:2]))
def test_a_full_disk_is_told_and_with_room_the_result_is_the_same(
    inputs: Path, tmp_path: Path, capsys, command: str
) -> None:
    def run(folder: Path) -> int:
        return cli.main(command.replace("IN", str(inputs)).replace("OUT", str(folder)).split())

    assert run(tmp_path / "expected") == 0
    expected = contents(tmp_path / "expected")
    for share in SHARES:
        folder = tmp_path / str(share)
        capsys.readouterr()
        with largest_file(int(share * max(map(len, expected.values())))):
            assert run(folder) == 1
        said = capsys.readouterr().err
        assert re.search(r"'[^']+': cannot be written", said), said
        assert "Traceback" not in said
        assert not list(folder.rglob(".*.tmp"))
        for name, content in contents(folder).items():
            if ".digs-warp.unfinished/" not in name:
                assert is_whole(folder / name, content, expected.get(name)), name
        assert run(folder) == 0
        assert contents(folder) == expected
