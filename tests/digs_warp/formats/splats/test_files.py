"""Splat files by suffix: frames, broken rows, what happens when writing fails."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, NO_FILTER, ScreenFilter
from digs_warp.formats.splats.files import WRITABLE as SUFFIXES
from digs_warp.formats.splats.files import SplatWriting, read_splat_file, write_splat_file
from digs_warp.formats.splats.rows import (
    WORLD_FROM_UP,
    codes_from_logits,
    logits_from_codes,
    turned,
)
from digs_warp.geometry.sh import rgb_from_sh
from reference.full_disk import largest_file
from reference.splat_files import random_gaussians, shapes


@pytest.mark.parametrize("up", ["y", "-y"])
def test_turned_gaussians_look_the_same_from_the_turned_side(up: str) -> None:
    g = random_gaussians(30, 3)
    rotation = WORLD_FROM_UP[up]
    there = turned(g, rotation)
    np.testing.assert_array_equal(there.means, g.means @ rotation.T)
    np.testing.assert_allclose(shapes(there), rotation @ shapes(g) @ rotation.T, atol=1e-5)
    directions = np.random.default_rng(2).normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(
        rgb_from_sh(there.sh, directions @ rotation.T), rgb_from_sh(g.sh, directions), atol=1e-5
    )


@pytest.mark.parametrize(
    ("suffix", "up", "axis"),
    [(".ply", "z", 2), (".ply", "-y", 1), (".splat", "y", 1), (".splat", "-y", 1)],
)
def test_up_is_the_axis_that_the_caller_names(tmp_path: Path, suffix: str, up, axis: int) -> None:
    g = random_gaussians(3, 0)
    g.means[:] = (0, 0, 1)
    path = tmp_path / f"a{suffix}"
    write_splat_file(path, g, SplatWriting(up))
    stored = read_splat_file(path)
    assert stored.means[0, axis] == (-1 if up.startswith("-") else 1)
    np.testing.assert_array_equal(read_splat_file(path, up=up).means, g.means)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("means", np.nan),
        ("means", np.inf),
        ("log_scales", np.inf),
        ("quats", np.nan),
        ("sh", np.inf),
    ],
)
def test_broken_rows_are_counted_refused_or_dropped(
    tmp_path: Path, field: str, value: float, caplog: pytest.LogCaptureFixture
) -> None:
    from digs_warp.formats.splats.ply import write_ply

    g = random_gaussians(10, 1)
    getattr(g, field)[[4, 7]] = value
    write_ply(tmp_path / "a.ply", g)
    with pytest.raises(DigsError, match=r"2 of 10 Gaussians.*first is number 4.*--drop-broken"):
        read_splat_file(tmp_path / "a.ply")
    read = read_splat_file(tmp_path / "a.ply", drop_broken=True)
    np.testing.assert_array_equal(read.means, np.delete(g.means, [4, 7], axis=0))
    assert "2 of 10" in caplog.text


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_broken_rows_are_not_written(tmp_path: Path, suffix: str) -> None:
    g = random_gaussians(3, 0)
    g.sh[1] = np.nan
    with pytest.raises(DigsError, match="1 of 3 Gaussians hold NaN"):
        write_splat_file(tmp_path / f"a{suffix}", g)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    write_splat_file(path, random_gaussians(5, 0))
    before = path.read_bytes()
    with largest_file(1000), pytest.raises(DigsError, match=r"cannot be written .*unchanged"):
        write_splat_file(path, random_gaussians(2000, 0))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_targets_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.ply").mkdir()
    for path in (tmp_path / "file/a.ply", tmp_path / "folder.ply"):
        with pytest.raises(DigsError, match="cannot be written"):
            write_splat_file(path, random_gaussians(1, 0))
    with pytest.raises(DigsError, match=r"suffix '.obj', expected one of .ply"):
        write_splat_file(tmp_path / "a.obj", random_gaussians(1, 0))
    with pytest.raises(DigsError, match="cannot hold 0 Gaussians"):
        write_splat_file(tmp_path / "a.splat", random_gaussians(0, 0))


def test_sources_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(DigsError, match="found a folder"):
        read_splat_file(tmp_path / "folder.ply")
    with pytest.raises(DigsError, match="no such file"):
        read_splat_file(tmp_path / "none.spz")
    with pytest.raises(DigsError, match="expected one of"):
        read_splat_file(tmp_path / "a.ksplat")


def test_every_opacity_code_survives_a_round_trip() -> None:
    every = np.arange(256, dtype=np.uint8)
    logits = logits_from_codes(every)
    assert np.isfinite(logits).all()
    np.testing.assert_array_equal(codes_from_logits(logits), every)


@pytest.mark.parametrize("suffix", [".ply", ".spz"])
def test_no_gaussians_at_all(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    write_splat_file(path, random_gaussians(0, 2), SplatWriting("y"))
    assert len(read_splat_file(path, up="y")) == 0


@pytest.mark.parametrize(
    ("suffix", "made_for", "read"),
    [
        (".ply", NO_FILTER, NO_FILTER),
        (".ply", ScreenFilter(0.05), ScreenFilter(0.05)),
        *((suffix, CLASSIC, CLASSIC) for suffix in SUFFIXES),
        *((suffix, ANTIALIASED, ANTIALIASED) for suffix in (".ply", ".spz")),
        # What the formats cannot say: see `nearest_known`.
        (".spz", NO_FILTER, ANTIALIASED),
        (".splat", NO_FILTER, CLASSIC),
    ],
)
def test_what_a_file_is_for_stands_in_it(
    tmp_path: Path, suffix: str, made_for: ScreenFilter, read: ScreenFilter
) -> None:
    path = tmp_path / f"a{suffix}"
    write_splat_file(
        path, replace(random_gaussians(5, 1), screen_filter=made_for), SplatWriting("y")
    )
    assert read_splat_file(path, up="y").screen_filter == read
