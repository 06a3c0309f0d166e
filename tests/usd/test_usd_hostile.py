"""Broken and hostile files: a clear error, nothing lost, no crash, no memory blow-up."""

import sys
from pathlib import Path

import pytest
from fuzz import fuzz, table
from fuzzing.kinds import find_kinds

from digs_warp.checks import UsdError
from digs_warp.usd import walk
from digs_warp.usd.capture_scene import CaptureScene, write_capture_scene
from digs_warp.usd.reader import describe, read_gaussians
from digs_warp.usd.validate import validate
from digs_warp.usd.writer import write_gaussians
from reference.splat_files import random_gaussians

HEAD, DEPTH = "#usda 1.0\n", 100_000
# Each ends a process that opens it: the library reads them by recursion.
ENDLESS = {
    "lists": HEAD + 'def "A" { int[] x = ' + "[" * DEPTH,
    "dictionaries": HEAD + "(\ncustomLayerData = {\n" + "dictionary a = {\n" * DEPTH,
    "prims": HEAD + 'def "A" {\n' * DEPTH,
    "expression": HEAD + 'def "A" (references = @`' + "if(" * DEPTH + "`@) {}",
}


@pytest.mark.parametrize("name", ENDLESS)
def test_a_file_that_ends_the_library_is_an_error(tmp_path: Path, name: str):
    (tmp_path / "inner.usda").write_text(ENDLESS[name])
    outer = tmp_path / "scene.usda"
    outer.write_text(HEAD + "(\nsubLayers = [@inner.usda@]\n)\n")
    with pytest.raises(UsdError, match=r"scene.usda': ends OpenUSD with SIG.*the file is broken"):
        read_gaussians(outer)


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("kill -ABRT $$", "ends OpenUSD with SIGABRT"),
        ("kill -XCPU $$", "keeps OpenUSD busy for more than 8 s"),
        (f"exit {walk.OUT_OF_MEMORY}", r"wants far more memory than its \d+ bytes"),
        ("exit 1", None),  # no Python there: nothing is known of the file
    ],
)
def test_how_the_trial_ends_is_told(tmp_path: Path, monkeypatch, script: str, message: str | None):
    path, python = tmp_path / "scene.usdc", tmp_path / "python"
    write_gaussians(path, random_gaussians(5))
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    for read in (read_gaussians, describe, validate):
        read(path)  # just written, so not tried
    path.touch()
    for read in (read_gaussians, describe, validate):
        if message is None:
            read(path)
        else:
            with pytest.raises(UsdError, match=message):
                read(path)


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    """`python scripts/fuzz.py --kind scene` does the same at length."""
    kinds = find_kinds(["scene: usd"])
    tallies = fuzz(kinds, count=3, seed=7, keep=tmp_path / "kept")
    assert not list(tmp_path.glob("kept/*")), table(tallies).text()
    assert {each.end for outcomes in tallies.values() for each in outcomes} <= {"read", "refused"}


@pytest.mark.parametrize("place", ["/proc/self/scene.usdz", "{tmp}/file/scene.usdz"])
def test_places_that_cannot_be_written_are_an_error_that_names_them(tmp_path: Path, place: str):
    (tmp_path / "file").write_bytes(b"no folder")
    path, splats = Path(place.format(tmp=tmp_path)), random_gaussians(2)
    for write in (write_gaussians, lambda at, g: write_capture_scene(at, CaptureScene(g))):
        with pytest.raises(UsdError, match=r"scene\.usdz': cannot be written"):
            write(path, splats)
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]
