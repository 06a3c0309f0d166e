"""Disks that run full: a small file system where it may be mounted, and a limit on the size of files."""

import resource
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PAGE = 4096  # a file takes whole pages


class MountError(Exception):
    """This user may not mount a file system."""


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let the system refuse to write more than ``size`` bytes into a file, also for libraries."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[Path]:
    """Mount a file system of ``size`` bytes, in whole pages, at ``folder`` for the block.

    Raises:
        MountError: not allowed here.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _mount(f"size={size}", "-t", "tmpfs", "small-disk", str(folder))
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def resize(folder: Path, size: int) -> None:
    """Change the size of what `small_disk` mounted."""
    _mount(f"remount,size={size}", str(folder))


def _mount(options: str, *where: str) -> None:
    try:
        done = subprocess.run(
            ["mount", "-o", options, *where], check=False, capture_output=True, text=True
        )
    except FileNotFoundError as error:
        raise MountError("there is no program 'mount'") from error
    if done.returncode:
        raise MountError(done.stderr.strip())
