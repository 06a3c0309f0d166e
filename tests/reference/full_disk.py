"""Disks that run full, for tests."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from full_disks import disk


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[Path]:
    """Mount a file system of ``size`` bytes (pages of 4096) at ``folder``, or skip the test."""
    try:
        with disk.small_disk(folder, size):
            yield folder
    except disk.MountError as error:
        pytest.skip(f"needs the right to mount a file system ({error})")
