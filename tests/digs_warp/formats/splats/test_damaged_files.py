"""Some hundreds of damaged files (thousands: `python tests/reference/fuzz_splats.py 6000`)."""

import subprocess
import sys

from reference import fuzz_splats


def test_damaged_files_are_read_or_refused() -> None:
    """In a separate process, so that a crash, a hang or too much memory is noticed."""
    done = subprocess.run(
        [sys.executable, fuzz_splats.__file__, "600", "--seed", "1"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert "600 files" in done.stdout
    # All formats, both ends.
    assert all(f"{suffix} " in done.stdout for suffix in (".ply", ".spz", ".splat"))
    assert "refused / refused" in done.stdout
    assert "read / read" in done.stdout
