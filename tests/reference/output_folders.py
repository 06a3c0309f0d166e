"""Output folders as runs leave them, and what is in them."""

import hashlib
from pathlib import Path

from digs_warp.commands.output import OutputFolder
from digs_warp.record.files import write_atomically
from digs_warp.record.manifest import recorded_files
from digs_warp.record.run_log import RunLog

# A recording that takes a moment.
SMALL = "--frames 2 --width 32 --height 18 --samples-per-pixel 1 --tier truth".split()


def our_folder(path: Path, command: str = "simulate") -> Path:
    """A folder as an earlier run left it."""
    with recorded_files(path):
        RunLog(command, {"frames": 3}).save(path / "run.json")
        write_atomically(path / "old.txt", b"from an earlier run")
    return path


def state(folder: Path) -> dict[str, str]:
    """Every file and folder below ``folder``, with the bytes and the time of each file."""
    return {
        str(path.relative_to(folder)): f"{path.stat().st_mtime_ns} "
        + hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else "folder"
        for path in folder.rglob("*")
    }


def write(folder: OutputFolder, name: str = "new.txt", text: str = "new") -> None:
    with folder.opened() as work:
        RunLog("simulate", {"frames": 4}).save(work / "run.json")
        write_atomically(work / name, text.encode())


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())
