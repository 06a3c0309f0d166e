"""The kernels are compiled ahead: all of them, in few sets, once."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import warp as wp

from digs_warp.commands import precompile


def test_all_kernels_are_in_six_sets_of_options(tmp_path: Path, monkeypatch) -> None:
    # Each more costs a first run as much as ten small modules.
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    sources = precompile._sources_with_warp()
    sets = precompile._sets(sources)
    kernels = {name for name, text in sources.items() if "@wp.kernel" in text}
    only_on_gpus = {"digs_warp.splat.cooperative"}
    assert {name for each in sets for name in each} == kernels - only_on_gpus
    assert len(sets) == 6


def test_what_is_compiled_is_not_compiled_again(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    one = {"digs_warp.splat.bin_tiles": "@wp.kernel"}
    monkeypatch.setattr(precompile, "_sources_with_warp", lambda: one)
    assert precompile.compile_kernels() > 0.0
    assert [each.name[:-8] for each in tmp_path.glob("wp_*")] == ["wp_digs_warp.splat.bin_tiles"]
    assert precompile._sets(one) == []
    assert precompile.compile_kernels() == 0.0


@pytest.mark.long
def test_nothing_is_left_to_compile_for_a_run(tmp_path: Path) -> None:
    code = f"""
from digs_warp.cli import main
from digs_warp.device.warp_start import compile_seconds
sizes = ["--frames", "9", "--width", "160", "--height", "90", "--iterations", "20"]
assert main(["run", "--out", {str(tmp_path / "out")!r}, *sizes]) == 0
assert compile_seconds() == 0.0
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"WARP_CACHE_PATH": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
