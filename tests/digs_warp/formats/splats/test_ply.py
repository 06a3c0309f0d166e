"""PLY in the layout of 3D Gaussian splatting: exact both ways, every encoding, clear refusals."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import (
    ANTIALIASED,
    CLASSIC,
    FIELDS,
    NO_FILTER,
    Gaussians,
    ScreenFilter,
)
from digs_warp.data.ply_table import read_ply_header
from digs_warp.formats.splats.files import read_splat_file
from digs_warp.formats.splats.ply import read_ply, write_ply
from digs_warp.geometry.sh import C0
from reference.splat_files import random_gaussians


def assert_equal(a: Gaussians, b: Gaussians) -> None:
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def test_layout_is_the_one_of_graphdeco(tmp_path: Path) -> None:
    """Column by column, by the text of the layout: wxyz, red before green before blue."""
    g = random_gaussians(2, 1)
    write_ply(tmp_path / "a.ply", g)
    header = read_ply_header(tmp_path / "a.ply")
    lines = (tmp_path / "a.ply").read_bytes().splitlines()
    assert lines[2] == b"element vertex 2"  # where the SIBR viewer reads it, whatever it is
    assert b"comment digs_warp screen dilation 0 px^2" in lines
    rest = [f"f_rest_{i}" for i in range(9)]
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *rest, "opacity"]
    names += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    assert list(header.elements[0].columns) == names
    data = (tmp_path / "a.ply").read_bytes()[header.data_start :]
    row = dict(zip(names, np.frombuffer(data, "<f4")[: len(names)], strict=True))
    assert [row[f"rot_{i}"] for i in range(4)] == [g.quats[0, 3], *g.quats[0, :3]]
    red, green, blue = (g.sh[0, 1:, channel].tolist() for channel in range(3))
    assert [row[name] for name in rest] == [*red, *green, *blue]
    assert row["opacity"] == g.opacity_logits[0]
    assert row["nx"] == 0


@pytest.mark.parametrize(
    ("comments", "expected"),
    [
        ([], CLASSIC),
        (["Exported from Brush", "SplatRenderMode: mip"], ANTIALIASED),
        (["SPLATRENDERMODE:   Default"], CLASSIC),
        (["SplatRenderMode: banana"], CLASSIC),
        (["antialiased 1"], ANTIALIASED),
        (["antialiased 0"], CLASSIC),
        (["digs_warp screen dilation 0 px^2", "SplatRenderMode: mip"], NO_FILTER),
        (["SplatRenderMode: mip", "digs_warp screen dilation 0.05 px^2"], ScreenFilter(0.05)),
        (["digs_warp screen dilation 999 px^2"], CLASSIC),
        (["digs_warp screen dilation nan px^2"], CLASSIC),
    ],
)
def test_comments_say_what_the_splats_are_drawn_with(
    tmp_path: Path, comments: list[str], expected: ScreenFilter
) -> None:
    path = tmp_path / "a.ply"
    write_ply(path, random_gaussians(3, 0))
    head, body = path.read_bytes().split(b"end_header\n", 1)
    head = b"".join(line for line in head.splitlines(True) if not line.startswith(b"comment"))
    notes = "".join(f"comment {each}\n" for each in comments).encode()
    path.write_bytes(head + notes + b"end_header\n" + body)
    assert read_ply(path).screen_filter == expected


def rewritten(path: Path, encoding: str, kind: str) -> Path:
    """The PLY file ``path`` again, in another encoding and number type, with a column more."""
    header = read_ply_header(path)
    names = list(header.elements[0].columns)
    rows = np.frombuffer(path.read_bytes()[header.data_start :], "<f4").reshape(-1, len(names))
    text = [f"ply\nformat {encoding} 1.0\ncomment by hand\nelement camera 1\nproperty uchar id"]
    text += [f"element vertex {len(rows)}", "property uchar label"]
    text += [f"property {kind} {name}" for name in names] + ["end_header\n"]
    if encoding == "ascii":
        lines = ["7"] + [" ".join(["3", *(f"{value:.9g}" for value in row)]) for row in rows]
        body = ("\n".join(lines) + "\n").encode()
    else:
        order = "<" if "little" in encoding else ">"
        number = {"float": "f4", "double": "f8"}[kind]
        table = np.zeros(len(rows), dtype=[("label", "u1"), ("row", order + number, len(names))])
        table["row"] = rows
        body = b"\x07" + table.tobytes()
    target = path.with_name(f"{encoding}-{kind}.ply")
    target.write_bytes("\n".join(text).encode() + body)
    return target


@pytest.mark.parametrize(
    ("encoding", "kind", "count"),
    [
        ("ascii", "float", 5000),  # read in pieces
        ("binary_little_endian", "double", 5),
        ("binary_big_endian", "float", 5),
    ],
)
def test_other_encodings_say_the_same(tmp_path: Path, encoding: str, kind: str, count: int) -> None:
    gaussians = random_gaussians(count, 2 if count == 5 else 0)
    write_ply(tmp_path / "a.ply", gaussians)
    assert_equal(read_ply(rewritten(tmp_path / "a.ply", encoding, kind)), gaussians)


def test_infinite_logits_mean_opaque_and_invisible(tmp_path: Path) -> None:
    """The SPZ library writes them for the codes 255 and 0."""
    gaussians = random_gaussians(2, 0)
    gaussians.opacity_logits[:] = np.inf, -np.inf
    write_ply(tmp_path / "a.ply", gaussians)
    read = read_splat_file(tmp_path / "a.ply")
    assert read.opacities[0] == 1.0
    assert 0.0 <= read.opacities[1] < 1e-16


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("ply\n", "plx\n", "not a PLY file"),
        ("end_header", "end_headex", "end_header"),
        ("vertex 3", "vertex 1000000000000", "1000000000000 rows of 68 bytes need"),
        ("vertex 3", "vertex -3", "expected a whole number"),
        ("vertex 3", "vertex 4", "truncated or damaged"),
        ("element vertex", "element points", "no 'vertex' element; found points"),
        ("float opacity", "float opaqueness", "no property opacity.*a mesh or a point cloud"),
        ("float opacity", "uint opacity", "'opacity' holds uint32, expected float"),
        ("float opacity", "list uchar int opacity", "holds lists"),
        ("float scale_1", "float scale_0", "'scale_0' occurs twice"),
        ("float nx", "float f_rest_0", "1 properties f_rest"),
        ("format binary_little_endian 1.0\n", "", "no 'format' line"),
        ("binary_little_endian", "ascii", "do not fit|expected 17 numbers"),
        ("element vertex", "element chunk 0\nelement vertex", "chunk. has no properties"),
    ],
)
def test_damage_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "a.ply"
    write_ply(path, random_gaussians(3, 0))
    header, end, body = path.read_bytes().partition(b"end_header\n")
    text = (header + end).decode()
    assert old in text
    path.write_bytes(text.replace(old, new).encode() + body)
    with pytest.raises(DigsError, match=message) as error:
        read_ply(path)
    assert str(path) in str(error.value)


def test_vertex_colors_are_for_programs_of_points(tmp_path: Path) -> None:
    gaussians = random_gaussians(40, 2)
    gaussians.sh[:2, 0] = [-9.0, 0.0, 9.0]  # beyond what 8 bits hold
    path = tmp_path / "colored.ply"
    write_ply(path, gaussians, vertex_colors=True)
    assert_equal(read_ply(path), gaussians)
    cloud = trimesh.load(path)
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_allclose(cloud.vertices, gaussians.means)
    expected = (0.5 + C0 * gaussians.sh[:, 0]).clip(0.0, 1.0) * 255.0
    np.testing.assert_allclose(cloud.colors[:, :3], expected, atol=0.5001)
