"""What is in a folder, to compare two of them."""

import hashlib
from pathlib import Path

from digs_warp.record.layout import MANIFEST, RUN_RECORD


def file_hashes(folder: Path) -> dict[str, str]:
    """Return path -> SHA-256 of every file below ``folder``, without run records and manifests."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in (RUN_RECORD, MANIFEST)
    }
