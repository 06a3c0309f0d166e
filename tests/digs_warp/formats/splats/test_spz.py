"""SPZ: precision of the format, its frame, other programs' files, damage."""

import gzip
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from fuzzing.originals import spz_4

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS
from digs_warp.formats.splats import spz as codes
from digs_warp.formats.splats.files import read_splat_file
from digs_warp.formats.splats.rows import WORLD_FROM_Y_UP, turned
from digs_warp.formats.splats.spz import read_spz, write_spz
from digs_warp.geometry.sh import C0
from reference.splat_files import random_gaussians, shapes


def test_reading_and_writing_again_changes_nothing_but_turns(tmp_path: Path) -> None:
    write_spz(tmp_path / "a.spz", random_gaussians(200, 3))
    write_spz(tmp_path / "b.spz", read_spz(tmp_path / "a.spz"))
    a, b = (gzip.decompress((tmp_path / f"{name}.spz").read_bytes()) for name in "ab")
    turns = slice(16 + 200 * 16, 16 + 200 * 20)
    assert a[: turns.start] == b[: turns.start] and a[turns.stop :] == b[turns.stop :]


@pytest.mark.parametrize(("count", "degree"), [(0, 3), (1, 0), (300, 3)])
def test_version_four_holds_the_same(tmp_path: Path, count: int, degree: int) -> None:
    write_spz(tmp_path / "a.spz", random_gaussians(count, degree))
    (tmp_path / "4.spz").write_bytes(spz_4((tmp_path / "a.spz").read_bytes(), count, degree))
    read, newer = (read_spz(tmp_path / f"{name}.spz") for name in "a4")
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(newer, name), getattr(read, name))


def test_rotations_of_version_two_are_three_bytes(tmp_path: Path) -> None:
    write_spz(tmp_path / "a.spz", random_gaussians(50, 1))
    read = read_spz(tmp_path / "a.spz")
    data = gzip.decompress((tmp_path / "a.spz").read_bytes())
    quats = upright(turned(read, WORLD_FROM_Y_UP.T).quats)
    rows, start = np.rint(127.5 * (quats[:, :3] + 1)).astype(np.uint8), 16 + 50 * 16
    parts = data[:4], b"\2", data[5:start], rows.tobytes(), data[start + 50 * 4 :]
    (tmp_path / "2.spz").write_bytes(b"".join(parts))
    older = read_spz(tmp_path / "2.spz")
    found = upright(turned(older, WORLD_FROM_Y_UP.T).quats)
    np.testing.assert_allclose(found[:, :3], quats[:, :3], atol=0.6 / 127.5)
    np.testing.assert_array_equal(older.sh, read.sh)


def test_colors_of_degree_four_are_read_to_the_third(tmp_path: Path, caplog) -> None:
    write_spz(tmp_path / "a.spz", random_gaussians(2, 3))
    data = gzip.decompress((tmp_path / "a.spz").read_bytes())
    rows = [data[-90:][45 * i : 45 * i + 45] + bytes(range(27)) for i in range(2)]
    parts = (data[:12], b"\4", data[13:-90], *rows)
    (tmp_path / "4.spz").write_bytes(gzip.compress(b"".join(parts)))
    read, newer = (read_spz(tmp_path / f"{name}.spz") for name in "a4")
    np.testing.assert_array_equal(newer.sh, read.sh)
    assert "colors above degree 3 are left out" in caplog.text


def upright(quats: np.ndarray) -> np.ndarray:
    """The same rotations with w of 0 or more."""
    return quats * np.where(quats[:, 3:] < 0, -1, 1)


def test_bytes_of_one_gaussian_and_up_is_y_in_the_file(tmp_path: Path) -> None:
    """By hand: a metre above the origin; e^-4, e^0; opacity 1/2; dc 1 is 255 (.15 + .5)."""
    g = random_gaussians(1, 0)
    g.means[:], g.log_scales[:], g.quats[:] = (0, 0, 1), (-4, -4, 0), (0, 0, 0, 1)
    g.opacity_logits[:], g.sh[:] = 0, 1
    write_spz(tmp_path / "a.spz", g)
    data = gzip.decompress((tmp_path / "a.spz").read_bytes())
    place = [int.from_bytes(data[16 + 3 * i : 19 + 3 * i], "little") for i in range(3)]
    assert place == [0, 1 << data[13], 0]
    assert list(data[25:32]) == [128, 166, 166, 166, 96, 96, 160]
    there = turned(read_spz(tmp_path / "a.spz"), WORLD_FROM_Y_UP.T)
    np.testing.assert_allclose(shapes(there)[0], np.diag([-4, 0, -4]), atol=0.02)


def test_positions_take_the_bits_that_the_scene_leaves_and_cuts_are_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, g = tmp_path / "a.spz", random_gaussians(10, 1)
    for far, bits in ((1.0, 20), (100.0, 16), (8.3e6, 0)):
        g.means[0] = far
        write_spz(path, g)
        assert gzip.decompress(path.read_bytes())[13] == bits
        np.testing.assert_allclose(read_spz(path).means[0], far, atol=2.0**-bits)
    g.log_scales[0, 0], g.log_scales[1, 1] = -12, 8
    g.sh[2, 0, 0], g.sh[3, 2, 1] = 5, 1.5
    write_spz(path, g)
    for loss in ("thickened", "larger than 380 m", "colors far", "SH coefficients beyond 1"):
        assert "1 of 10 Gaussians" in caplog.text and loss in caplog.text
    g.means[0] = 1e7
    with pytest.raises(DigsError, match="1e\\+07 m from the origin"):
        write_spz(tmp_path / "b.spz", g)
    assert not (tmp_path / "b.spz").exists()


def test_quaternions_smallest_three() -> None:
    """Largest component w (index 3), then x, y, z with 9 bits in units of sqrt(1/2)/511 and a sign."""
    s = np.sqrt(0.5)
    data = codes.encode_quats(np.array([[-s / 511 * 100, s / 511 * 7, 0.0, 0.9]]))
    assert int.from_bytes(data.tobytes(), "little") == 3 << 30 | (1 << 9 | 100) << 20 | 7 << 10
    quats = np.random.default_rng(3).normal(size=(500, 4))
    quats[:4] = np.eye(4)
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    read = codes.decode_quats(codes.encode_quats(quats)).astype(np.float64)
    aligned = np.abs(np.einsum("ni,ni->n", quats, read)) / np.linalg.norm(read, axis=1)
    assert (2 * np.arccos(np.minimum(aligned, 1.0))).max() < 4 * s / 511


def test_samples_of_the_format_mean_the_same_in_every_version(sample_data: Path) -> None:
    """Of other programs; version 4 lists a stream of length 0."""
    folder = sample_data / "splats/splat_transform_minimal"
    plain = read_splat_file(folder / "minimal.splat", up="-y")
    for name in ("v3", "v4"):
        read = read_splat_file(folder / f"minimal-{name}.spz")
        np.testing.assert_allclose(read.means, plain.means, atol=2.0**-12)
        np.testing.assert_allclose(read.log_scales, plain.log_scales, atol=1 / 32)
        np.testing.assert_allclose(read.opacities, plain.opacities, atol=1 / 255)
        np.testing.assert_allclose(read.sh, plain.sh, atol=0.5 / 255 / 0.15 + 1 / 255)
    gzipped, raw = (read_splat_file(folder / f"minimal-{name}.spz") for name in ("v2", "raw"))
    np.testing.assert_array_equal(gzipped.means, raw.means)
    np.testing.assert_array_equal(gzipped.quats, raw.quats)


def test_sample_of_a_trained_scene_is_equal_in_three_formats(sample_data: Path) -> None:
    """Three Gaussians of a scene trained from COLMAP (y down in PLY and .splat; SPZ says y up)."""
    stem = sample_data / "splats/three_trained_points/test-splat.3-points-from-train"
    ply = read_splat_file(stem.with_name(stem.name + ".ply"), up="-y")
    splat = read_splat_file(stem.with_name(stem.name + ".splat"), up="-y")
    spz = read_splat_file(stem.with_name(stem.name + ".spz"))
    assert (ply.sh_degree, splat.sh_degree, spz.sh_degree) == (3, 0, 3)
    np.testing.assert_allclose(splat.means, ply.means, rtol=0)
    np.testing.assert_allclose(splat.log_scales, ply.log_scales, atol=1e-6)
    np.testing.assert_allclose(splat.opacities, ply.opacities, atol=1 / 255)
    np.testing.assert_allclose(splat.sh[:, 0], ply.sh[:, 0], atol=1 / 255 / C0)
    np.testing.assert_allclose(shapes(splat), shapes(ply), atol=0.05)
    np.testing.assert_allclose(spz.means, ply.means, atol=2.0**-13 + 1e-6)
    np.testing.assert_allclose(spz.opacities, ply.opacities, atol=1 / 255)
    np.testing.assert_allclose(spz.sh[:, 0], ply.sh[:, 0], atol=1 / 255 / 0.15)
    # Rounded to 1/16 and 1/8 in the file's frame; the turn mixes at most 7 coefficients of a band.
    np.testing.assert_allclose(spz.sh[:, 1:4], ply.sh[:, 1:4], atol=1 / 32 + 1e-6)
    np.testing.assert_allclose(spz.sh[:, 4:], ply.sh[:, 4:], atol=7 / 16)
    np.testing.assert_allclose(shapes(spz), shapes(ply), atol=1 / 32 + 0.03)


def header(version: int = 3, count: int = 1, degree: int = 0, bits: int = 12, flags: int = 0):
    return struct.pack("<IIIBBBB", 0x5053474E, version, count, degree, bits, flags, 0)


ONE = bytes(20)  # the attributes of one Gaussian of degree 0, version 3


def wrong_checksum() -> bytes:
    data = bytearray(gzip.compress(header() + ONE, mtime=0))
    data[-8] ^= 1
    return bytes(data)


def version_four(count: int, streams: list[bytes], sizes: list[int], table: int = 32) -> bytes:
    head = struct.pack("<IIIBBBBI12x", 0x5053474E, 4, count, 0, 12, 0, len(streams), table)
    entries = [struct.pack("<QQ", len(s), n) for s, n in zip(streams, sizes, strict=True)]
    return head + b"".join(entries) + b"".join(streams)


def zstd(size: int) -> bytes:
    return zstandard.ZstdCompressor().compress(bytes(size))


SIZES = [9, 1, 3, 3, 4]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"hello, world", "begins with b'hell'"),
        (gzip.compress(b"hello, hello, hello", mtime=0), "expected b'NGSP'"),
        (gzip.compress(header() + ONE, mtime=0)[:-9], "need 20 bytes|broken or truncated"),
        (gzip.compress(header() + ONE, mtime=0)[:20], "begins with|damaged|truncated"),
        (gzip.compress(header() + ONE + ONE, mtime=0), "need 20 bytes, found more"),
        (
            gzip.compress(header(version=1) + ONE, mtime=0),
            r"version 1, expected one of \(2, 3, 4\)",
        ),
        (gzip.compress(header(version=4) + ONE, mtime=0), "version 4 in a gzip stream"),
        (
            gzip.compress(header(count=4_000_000_000) + ONE, mtime=0),
            "4,000,000,000 Gaussians, expected up to 10,000,000",
        ),
        (
            gzip.compress(header(count=9_999_999) + ONE, mtime=0),
            "claims to unpack from .* to 199,999,980 bytes",
        ),
        (gzip.compress(header(degree=5) + ONE, mtime=0), "degree 5, expected 0 to 4"),
        (gzip.compress(header(bits=24) + ONE, mtime=0), "24 fractional bits"),
        (header() + ONE[:-1], "need 20 bytes, found 19"),
        (header()[:12], "begins with"),
        (wrong_checksum(), "incorrect data check"),
        (version_four(1, [zstd(n) for n in SIZES], SIZES)[:-3], "truncated|again"),
        (version_four(1, [zstd(n) for n in SIZES[:4]], SIZES[:4]), "4 streams, expected 5"),
        (version_four(1, [zstd(n) for n in SIZES], [9, 1, 3, 3, 5]), "5 streams, expected 5 of"),
        (version_four(1, [zstd(2 * n) for n in SIZES], SIZES), "unpacks to other than 9"),
        (version_four(1, [b"junk"] * 5, SIZES), "export the file again"),
        (version_four(1, [zstd(n) for n in SIZES], SIZES, table=9000), "broken or truncated"),
        (version_four(1, [zstd(n) for n in SIZES], SIZES, table=0), "5 streams"),
    ],
)
def test_damage_is_named(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "a.spz"
    path.write_bytes(data)
    with pytest.raises(DigsError, match=message) as error:
        read_spz(path)
    assert str(path) in str(error.value)


def test_a_gzip_bomb_is_not_unpacked(tmp_path: Path) -> None:
    """A hundred megabytes of zeros in a tenth of one, behind a header that promises one Gaussian."""
    import tracemalloc

    packer = zlib.compressobj(1, zlib.DEFLATED, 31)
    parts = [packer.compress(header())]
    parts += [packer.compress(bytes(1 << 24)) for _ in range(6)]
    (tmp_path / "a.spz").write_bytes(b"".join([*parts, packer.flush()]))
    tracemalloc.start()
    try:
        with pytest.raises(DigsError, match="found more"):
            read_spz(tmp_path / "a.spz")
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()
