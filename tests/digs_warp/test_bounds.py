"""Small files that promise a lot are refused by their headers: a clear error, little memory, no wait."""

import json
from pathlib import Path

import pytest

from digs_warp.bounds import FREE_UNPACKED, IMAGE, check_unpacked
from digs_warp.checks import DigsError
from reference import hostile_files
from reference.fresh_process import run_fresh

MOST_MEGABYTES, MOST_SECONDS = 1024, 10


def test_files_that_promise_a_lot_take_little_and_are_named(tmp_path: Path):
    hostile_files.make_all(tmp_path)
    program = "import sys, pathlib; from reference.hostile_files import read_all"
    done = run_fresh(f"{program}; read_all(pathlib.Path(sys.argv[1]))", tmp_path)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(rows) > 10
    for name, message, megabytes, seconds in rows:
        assert f"{name}" in message and "Error" not in message, (name, message)
        assert megabytes < MOST_MEGABYTES and seconds < MOST_SECONDS, (name, megabytes, seconds)


def test_the_largest_real_files_are_within_the_bounds():
    IMAGE.check("panorama", 16384 * 8192)
    with pytest.raises(
        DigsError, match=r"panorama: 800,000,000 pixels, expected up to 134,217,728"
    ):
        IMAGE.check("panorama", 40_000 * 20_000)


def test_what_compresses_well_may_unpack_to_a_few_megabytes():
    check_unpacked("it", 1000, FREE_UNPACKED)
    with pytest.raises(DigsError, match=r"it: claims to unpack from 1,000 to 20,000,000 bytes"):
        check_unpacked("it", 1000, 20_000_000)
