"""glTF, SOG and compressed PLY: the rules of Khronos, files of splat-transform, other transforms, damage."""

import json
import struct
import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from digs_warp.checks import DigsError
from digs_warp.cli import main
from digs_warp.data.gaussians import CLASSIC, Gaussians
from digs_warp.data.images import linear_from_srgb
from digs_warp.formats.splats.files import SplatWriting, read_splat_file, write_splat_file
from digs_warp.formats.splats.rows import WORLD_FROM_Y_UP, turned
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.geometry.sh import C0
from reference.splat_files import random_gaussians, shapes

DATA = Path(__file__).parent / "data"
KHR = "KHR_gaussian_splatting"
KINDS = {5126: "<f4", 5121: "<u1"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def parts_of(path: Path) -> tuple[dict[str, Any], bytes]:
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and size % 4 == 0
    binary, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0" and binary % 4 == 0 and 28 + size + binary == length
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def write_parts(path: Path, header: dict[str, Any], binary: bytes) -> None:
    text = json.dumps(header).encode()
    text += b"\0" * (4 + -len(text) % 4)  # of some programs, instead of blanks
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def attribute(header: dict[str, Any], binary: bytes, name: str) -> np.ndarray:
    """An accessor as glTF 2.0 says, read without the code under test."""
    number = header["meshes"][0]["primitives"][0]["attributes"][name]
    accessor = header["accessors"][number]
    view = header["bufferViews"][accessor["bufferView"]]
    width = WIDTHS[accessor["type"]]
    values = np.frombuffer(
        binary, KINDS[accessor["componentType"]], accessor["count"] * width, view["byteOffset"]
    )
    return values.reshape(-1, width)


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_a_glb_keeps_the_rules_of_khronos(tmp_path: Path, degree: int) -> None:
    """Those of the extension's text and schema: glTF's own validator does not know it yet."""
    g = random_gaussians(40, degree)
    write_splat_file(tmp_path / "a.glb", g)
    header, binary = parts_of(tmp_path / "a.glb")
    (primitive,) = header["meshes"][0]["primitives"]
    extension = primitive["extensions"][KHR]
    assert header["extensionsUsed"] == [KHR] and primitive["mode"] == 0
    assert (extension["kernel"], extension["colorSpace"]) == ("ellipse", "srgb_rec709_display")
    assert (extension["projection"], extension["sortingMethod"]) == (
        "perspective",
        "cameraDistance",
    )
    wanted = {"POSITION": "VEC3", "COLOR_0": "VEC4"}
    wanted |= {f"{KHR}:ROTATION": "VEC4", f"{KHR}:SCALE": "VEC3", f"{KHR}:OPACITY": "SCALAR"}
    wanted |= {
        f"{KHR}:SH_DEGREE_{band}_COEF_{number}": "VEC3"
        for band in range(degree + 1)
        for number in range(2 * band + 1)
    }
    found = {name: header["accessors"][i] for name, i in primitive["attributes"].items()}
    assert {name: accessor["type"] for name, accessor in found.items()} == wanted
    is_byte = {name: accessor["componentType"] == 5121 for name, accessor in found.items()}
    assert [name for name, byte in is_byte.items() if byte] == ["COLOR_0"]
    assert found["COLOR_0"]["normalized"]
    assert all(view["byteOffset"] % 4 == 0 for view in header["bufferViews"])

    there = turned(g, WORLD_FROM_Y_UP.T)
    positions = attribute(header, binary, "POSITION")
    np.testing.assert_array_equal(positions, there.means)
    np.testing.assert_allclose(found["POSITION"]["min"], positions.min(axis=0))
    np.testing.assert_allclose(found["POSITION"]["max"], positions.max(axis=0))
    rotations = attribute(header, binary, f"{KHR}:ROTATION")
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(
        matrix_from_quat_xyzw(rotations), matrix_from_quat_xyzw(there.quats), atol=1e-6
    )
    np.testing.assert_allclose(attribute(header, binary, f"{KHR}:SCALE"), g.scales)
    opacities = attribute(header, binary, f"{KHR}:OPACITY")[:, 0]
    np.testing.assert_allclose(opacities, g.opacities)
    for number, name in enumerate(name for name in wanted if "SH_" in name):
        np.testing.assert_array_equal(attribute(header, binary, name), there.sh[:, number])
    cloud = trimesh.load(tmp_path / "a.glb").geometry.popitem()[1]  # pyright: ignore
    np.testing.assert_array_equal(cloud.vertices, positions)
    plain = linear_from_srgb(np.clip(0.5 + C0 * g.sh[:, 0], 0, 1))
    np.testing.assert_allclose(cloud.colors[:, :3], 255 * plain, atol=0.51)
    np.testing.assert_allclose(cloud.colors[:, 3], 255 * opacities, atol=0.51)


@pytest.mark.parametrize("name", ["peer.glb", "peer.compressed.ply", "peer.sog"])
def test_files_of_splat_transform_hold_what_went_in(name: str) -> None:
    """They were made of these splats, as PLY. Where its axes count, x and y point the other way in it."""
    source = random_gaussians(12, 1)
    read = read_splat_file(DATA / name)
    if name == "peer.glb":
        source = turned(source, WORLD_FROM_Y_UP @ np.diag([-1.0, -1.0, 1.0]))
    pairs = np.linalg.norm(read.means[:, None] - source.means, axis=2)
    assert sorted(pairs.argmin(axis=1)) == list(range(12))
    source = source.select(pairs.argmin(axis=1))
    coarse = name != "peer.glb"
    np.testing.assert_allclose(read.means, source.means, atol=2e-3 if coarse else 1e-6)
    np.testing.assert_allclose(shapes(read), shapes(source), atol=0.08 if coarse else 1e-5)
    np.testing.assert_allclose(read.opacities, source.opacities, atol=4e-3)
    np.testing.assert_allclose(read.sh[:, 0], source.sh[:, 0], atol=0.03 if coarse else 1e-6)
    palette = 0.4  # which is of few rows there
    worst = {"peer.glb": 1e-6, "peer.compressed.ply": 0.03, "peer.sog": palette}[name]
    np.testing.assert_allclose(read.sh, source.sh, atol=worst)
    assert read.screen_filter == CLASSIC


@pytest.mark.parametrize("bits", [(5, 4), (6, 6), (8, 8)])
def test_spz_keeps_the_bits_of_view_dependent_color(tmp_path: Path, bits) -> None:
    g = random_gaussians(200, 3)
    there = turned(g, WORLD_FROM_Y_UP.T)  # where it is rounded
    write_splat_file(tmp_path / "a.spz", g, SplatWriting(spz_sh_bits=bits))
    read = turned(read_splat_file(tmp_path / "a.spz"), WORLD_FROM_Y_UP.T)
    for band, used in ((slice(1, 4), bits[0]), (slice(4, 16), bits[1])):
        off = np.abs(read.sh[:, band] - there.sh[:, band]).max()
        assert 2.0**-used / 2 < off < 2.0**-used + 1e-5


def test_nodes_move_turn_and_scale_splats_and_linear_colors_become_srgb(tmp_path: Path) -> None:
    g = random_gaussians(20, 2)
    linear = linear_from_srgb(np.clip(0.5 + C0 * g.sh[:, 0], 0, 1))
    g.sh[:, 1:] = 0
    stored = np.concatenate([((linear - 0.5) / C0)[:, None], g.sh[:, 1:]], axis=1)
    turn = [0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]  # a quarter about the file's y: our z
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    wanted = turned(replace(g, means=g.means + [0.5, 0, 0]), quarter)
    for space, sh in (("srgb_rec709_display", g.sh), ("lin_rec709_display", stored)):
        write_splat_file(tmp_path / "a.glb", replace(g, sh=sh))
        header, binary = parts_of(tmp_path / "a.glb")
        header["meshes"][0]["primitives"][0]["extensions"][KHR]["colorSpace"] = space
        moved = {"children": [0], "translation": [1, 2, 3], "rotation": turn, "scale": [2.5] * 3}
        header["nodes"][0]["translation"] = [0.5, 0, 0]
        header["nodes"].append(moved)
        header["scenes"][0]["nodes"] = [1]
        write_parts(tmp_path / "b.glb", header, binary)
        read = read_splat_file(tmp_path / "b.glb")
        np.testing.assert_allclose(read.means, 2.5 * wanted.means + [1, -3, 2], atol=1e-5)
        np.testing.assert_allclose(
            shapes(read), shapes(replace(wanted, log_scales=read.log_scales)), atol=1e-4
        )
        np.testing.assert_allclose(read.sh, wanted.sh, atol=1e-4)


def first(header: dict[str, Any]) -> dict[str, Any]:
    return header["meshes"][0]["primitives"][0]


def is_compressed(header: dict[str, Any]) -> None:
    del first(header)["attributes"][f"{KHR}:SCALE"]
    first(header)["extensions"][KHR]["extensions"] = {f"{KHR}_compression_spz_2": {}}


def has_logarithms(header: dict[str, Any]) -> None:
    """As an early splat-transform wrote them."""
    names = first(header)["attributes"]
    names[f"{KHR}:SCALE"] = names["POSITION"]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda h: first(h).pop("extensions"), f"no {KHR} in it, so no Gaussians: a mesh"),
        (is_compressed, f"without SCALE .{KHR}_compression_spz_2.; export it as plain"),
        (has_logarithms, "the file seems to hold logarithms"),
        (
            lambda h: first(h)["attributes"].pop(f"{KHR}:SH_DEGREE_0_COEF_0"),
            "splats without SH_DEGREE_0_COEF_0",
        ),
        (lambda h: h["accessors"][0].update(count=10**12), "1,000,000,000,000 Gaussians, expected"),
        (lambda h: h["accessors"][0].update(count=100_000), "broken or truncated"),
        (lambda h: h.update(bufferViews=[3] * 9), "broken or truncated .AttributeError"),
        (lambda h: h["nodes"][0].update(children=[0]), "nodes in a circle"),
        (lambda h: h["nodes"][0].update(scale=[1, 2, 3]), "scales its axes differently"),
    ],
)
def test_what_no_glb_can_hold_is_named(tmp_path: Path, spoil, message: str) -> None:
    write_splat_file(tmp_path / "a.glb", random_gaussians(20, 0))
    header, binary = parts_of(tmp_path / "a.glb")
    spoil(header)
    write_parts(tmp_path / "b.glb", header, binary)
    with pytest.raises(DigsError, match=message):
        read_splat_file(tmp_path / "b.glb")


def sog_with(path: Path, **files: bytes) -> None:
    write_splat_file(path, random_gaussians(20, 1))
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in (
            content | {k.replace("_json", ".json"): v for k, v in files.items()}
        ).items():
            archive.writestr(name, data)


def huge_picture() -> bytes:
    data = BytesIO()
    Image.new("RGBA", (8000, 8000)).save(data, "PNG")
    return data.getvalue()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"meta_json": b'{"count": 3}'}, "version 1, expected 2"),
        ({"meta_json": b'{"version": 2, "count": 3}'}, "broken or truncated .KeyError"),
        ({"meta_json": b'{"version": 2, "count": 99999999999}'}, "expected up to 10,000,000"),
        ({"means_l.webp": b"no picture"}, "broken or truncated"),
        ({"means_l.webp": huge_picture()}, "claims to unpack"),
    ],
)
def test_what_no_sog_can_hold_is_named(
    tmp_path: Path, files: dict[str, bytes], message: str
) -> None:
    sog_with(tmp_path / "a.sog", **files)
    with pytest.raises(DigsError, match=message):
        read_splat_file(tmp_path / "a.sog")
    (tmp_path / "b.sog").write_bytes(b"PK no archive")
    with pytest.raises(DigsError, match="broken or truncated"):
        read_splat_file(tmp_path / "b.sog")


def test_info_tells_splats_from_meshes(tmp_path: Path, capsys) -> None:
    random: Gaussians = random_gaussians(20, 1)
    for name in ("a.glb", "a.sog", "a.compressed.ply"):
        write_splat_file(tmp_path / name, random)
        assert main(["info", str(tmp_path / name)]) == 0
        assert "20 Gaussians" in capsys.readouterr().out
    trimesh.creation.box().export(tmp_path / "box.glb")
    assert main(["info", str(tmp_path / "box.glb")]) == 0
    assert "mesh" in capsys.readouterr().out
