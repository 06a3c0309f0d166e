"""Splat files by suffix: precision, frames, broken rows, what happens when writing fails."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, NO_FILTER, ScreenFilter
from digs_warp.formats.splats.dot_splat import ROW, read_dot_splat, write_dot_splat
from digs_warp.formats.splats.files import WRITABLE as SUFFIXES
from digs_warp.formats.splats.files import SplatWriting, read_splat_file, write_splat_file
from digs_warp.formats.splats.rows import (
    WORLD_FROM_UP,
    in_morton_order,
    turned,
)
from digs_warp.formats.splats.spz import COLOR_SCALE
from digs_warp.geometry.sh import C0, rgb_from_sh
from reference.full_disk import largest_file
from reference.optional import open3d_or_skip
from reference.splat_files import random_gaussians, shapes

# How far centers [m], log-scales (`shapes`), opacities, and coefficients of band 0 and above may be off.
CODE = 0.5 / 255 + 1e-6
OFF = {
    ".ply": (0, 0, 0, 0, 0),
    ".glb": (0, 1e-5, 1e-6, 1e-6, 1e-6),
    # Positions here are within 8 units, so 20 fractional bits; scales to 1/32; rounded in the file's frame.
    ".spz": (2.0**-21 + 1e-6, 0.05, CODE, CODE / COLOR_SCALE, 0.3),
    # A quaternion within 1/256 a component turns by at most 1/64; log-scales spread over 10.
    ".splat": (0, 10 / 64, CODE, CODE / C0, 0),
    ".compressed.ply": (3e-3, 0.12, CODE, 0.02, 0.03),
    ".sog": (1e-4, 0.12, CODE, 0.03, 1.2),  # of random colors, a palette keeps little
}


@pytest.mark.parametrize("suffix", OFF)
@pytest.mark.parametrize(("count", "degree"), [(1, 0), (3, 3), (4000, 1)])
def test_values_come_back_to_the_precision_of_the_format(
    tmp_path: Path, suffix: str, count: int, degree: int
) -> None:
    g = random_gaussians(count, 0 if suffix == ".splat" else degree)
    path = tmp_path / f"a{suffix}"
    if suffix in (".compressed.ply", ".sog"):
        # Few values far from all others.
        g.log_scales[:9, 0], g.sh[:9, 0, 0] = (
            np.linspace(2, far, min(9, count)) for far in (10, 6)
        )
        g = in_morton_order(g)
    write_splat_file(path, g)
    first = path.read_bytes()
    write_splat_file(path, g)
    assert path.read_bytes() == first
    read = read_splat_file(path)
    assert (len(read), read.sh_degree) == (len(g), g.sh_degree)
    means, shape, opacity, base, rest = OFF[suffix]
    close = partial(np.testing.assert_allclose, rtol=0)
    close(read.means, g.means, atol=means)
    close(shapes(read), shapes(g), atol=shape)
    close(read.opacities, g.opacities, atol=opacity)
    close(read.sh[:, 0], g.sh[:, 0], atol=base)
    close(read.sh[:, 1:], g.sh[:, 1:], atol=rest)
    assert np.square(read.sh[:, 1:] - g.sh[:, 1:]).sum() < 0.04 * max(1, g.sh[:, 1:].size)


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
    [("means", np.nan), ("log_scales", np.inf), ("quats", np.nan), ("sh", np.inf)],
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


def test_what_cannot_be_written_or_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.ply").mkdir()
    g = random_gaussians(1, 0)
    for name, message in (
        ("file/a.ply", "cannot be written"),
        ("folder.ply", "cannot be written"),
        ("a.obj", r"suffix '.obj', expected one of .ply"),
    ):
        with pytest.raises(DigsError, match=message):
            write_splat_file(tmp_path / name, g)
    for name, message in (
        ("folder.ply", "found a folder"),
        ("none.spz", "no such file"),
        ("a.ksplat", "expected one of"),
    ):
        with pytest.raises(DigsError, match=message):
            read_splat_file(tmp_path / name)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_no_gaussians_at_all(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    if suffix not in (".ply", ".spz"):
        with pytest.raises(DigsError, match="cannot hold 0 Gaussians; write PLY or SPZ"):
            write_splat_file(path, random_gaussians(0, 0))
    else:
        write_splat_file(path, random_gaussians(0, 2), SplatWriting("y"))
        assert len(read_splat_file(path, up="y")) == 0


@pytest.mark.parametrize(
    ("suffix", "made_for", "read"),
    [
        *((suffix, NO_FILTER, NO_FILTER) for suffix in (".ply", ".glb")),
        (".ply", ScreenFilter(0.05), ScreenFilter(0.05)),
        *((suffix, CLASSIC, CLASSIC) for suffix in SUFFIXES),
        *((suffix, ANTIALIASED, ANTIALIASED) for suffix in SUFFIXES if suffix != ".splat"),
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


@pytest.mark.parametrize(("suffix", "degree"), [(".ply", 2), (".splat", 0)])
def test_open3d_reads_the_same_values(tmp_path: Path, suffix: str, degree: int) -> None:
    """Another program's reader on our file; it says standard deviations and opacity logits."""
    open3d = open3d_or_skip()
    path = tmp_path / f"a{suffix}"
    write_splat_file(path, random_gaussians(20, degree))
    ours = read_splat_file(path)
    cloud = open3d.t.io.read_point_cloud(str(path))
    read = {name: cloud.point[name].numpy() for name in cloud.point}
    np.testing.assert_array_equal(read["positions"], ours.means)
    np.testing.assert_allclose(read["scale"], ours.scales, rtol=1e-5)
    quats, unit = (q / np.linalg.norm(q, axis=1)[:, None] for q in (read["rot"], ours.quats))
    np.testing.assert_allclose(quats, unit[:, [3, 0, 1, 2]], atol=1e-2)
    np.testing.assert_allclose(read["f_dc"], ours.sh[:, 0], atol=1e-2)
    if degree:
        np.testing.assert_array_equal(read["f_rest"].reshape(20, 8, 3), ours.sh[:, 1:])
        np.testing.assert_array_equal(read["opacity"].ravel(), ours.opacity_logits)


def test_bytes_of_one_gaussian_in_dot_splat(tmp_path: Path) -> None:
    """By hand: 1, 2, 3; e^0; dc 0 is gray 128; opacity 1/2; half a turn around x, wxyz."""
    g = random_gaussians(1, 0)
    g.means[:], g.log_scales[:], g.sh[:], g.opacity_logits[:] = (1, 2, 3), 0, 0, 0
    g.quats[:] = (2, 0, 0, 0)
    write_dot_splat(tmp_path / "a.splat", g)
    data = (tmp_path / "a.splat").read_bytes()
    np.testing.assert_array_equal(np.frombuffer(data[:24], "<f4"), [1, 2, 3, 1, 1, 1])
    assert list(data[24:]) == [128, 128, 128, 128, 128, 255, 128, 128]


def test_what_is_lost_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lossy = replace(random_gaussians(2, 1), screen_filter=ANTIALIASED)
    write_dot_splat(tmp_path / "a.splat", lossy)
    assert "view-dependent" in caplog.text and "antialiasing" in caplog.text


def test_zeros_are_read_and_what_is_no_splat_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.splat"
    row = np.zeros(2, ROW)
    row["quaternion"] = 128
    path.write_bytes(row.tobytes())
    read = read_dot_splat(path)
    assert np.isfinite(read.log_scales).all()
    np.testing.assert_array_equal(read.quats, 0)
    assert read.opacities[0] < 1 / 255
    row["scale"][1] = -1
    for data, message in (
        (bytes(31), "31 bytes, expected a multiple of 32"),
        (b"", "empty"),
        (row.tobytes(), "1 of 2 Gaussians have negative scales"),
    ):
        path.write_bytes(data)
        with pytest.raises(DigsError, match=message):
            read_dot_splat(path)
