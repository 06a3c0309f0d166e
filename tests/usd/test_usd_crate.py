"""The binary format: what we read of it is what the USD library wrote; broken tables are refused."""

import random
import struct
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import UsdError
from digs_warp.usd import crate, writer
from digs_warp.usd.crate import (
    COUNT,
    SECTION,
    decompressed,
    read_sections,
    section_bodies,
    splice,
    stored,
)
from digs_warp.usd.diff import differences
from digs_warp.usd.reader import describe, read_gaussians
from digs_warp.usd.structure import _integers, check_paths, check_structure
from digs_warp.usd.validate import validate
from digs_warp.usd.writer import write_gaussians
from reference.usd_files import run_fresh


def test_stored_blocks_come_back():
    for size in (0, 1, 14, 15, 16, 269, 270, 271, 5000):
        data = random.Random(size).randbytes(size)
        assert decompressed(stored(data), size) == data


def test_compressed_blocks_repeat_what_is_before():
    # By hand: "ab", a copy of 4 + 5 bytes from 2 before, then "c".
    block = bytes([0, 0x25]) + b"ab" + bytes([2, 0]) + bytes([0x10]) + b"c"
    assert decompressed(block, 100) == b"ababababab" + b"a" + b"c"


BROKEN_BLOCKS = {
    "empty": b"",
    "pieces": b"\1\x10a",
    "length": b"\0\xf0\xff",
    "literals": b"\0\x20a",
    "before the start": b"\0\x10a\2\0",
    "distance 0": b"\0\x10a\0\0",
    "too large": b"\0\x1fa\1\0\xff\xff\0",
}


def test_broken_blocks_are_refused():
    for block in BROKEN_BLOCKS.values():
        with pytest.raises(ValueError, match="compressed block"):
            decompressed(block, 100)


def deep_stage(path: Path, seed: int) -> None:
    """A scene of several hundred prims, properties, targets and variants, in a random tree."""
    from pxr import Sdf, Usd

    rng = random.Random(seed)
    stage = Usd.Stage.CreateNew(str(path))
    prims = [stage.DefinePrim("/Root", "Xform")]
    for i in range(300):
        prim = stage.DefinePrim(rng.choice(prims).GetPath().AppendChild(f"p{i}"))
        for k in range(rng.randrange(4)):
            prim.CreateAttribute(f"a{k}", Sdf.ValueTypeNames.Float).Set(rng.random())
        if rng.random() < 0.2:
            prim.CreateRelationship("to").AddTarget(rng.choice(prims).GetPath())
        if rng.random() < 0.1:
            sets = prim.GetVariantSets().AddVariantSet("kind")
            for name in ("one", "two"):
                sets.AddVariant(name)
                sets.SetVariantSelection(name)
                with sets.GetVariantEditContext():
                    stage.DefinePrim(prim.GetPath().AppendChild("inner"))
        prims.append(prim)
    stage.GetRootLayer().Save()


def test_paths_of_any_scene_of_the_library_are_accepted(tmp_path: Path):
    for seed in range(2):
        path = tmp_path / f"scene{seed}.usdc"
        deep_stage(path, seed)
        check_structure(path)


def with_paths(crate: bytes, change) -> bytes:
    """Return a crate whose three columns of paths, as plain differences of four bytes, are changed."""
    sections = {each.name: each for each in read_sections(crate, "it", 0, len(crate))}
    section = sections["PATHS"]
    (count,) = COUNT.unpack_from(crate, section.start + 8)
    at = section.start + 16
    body = crate[section.start : at]
    for column in range(3):
        (size,) = COUNT.unpack_from(crate, at)
        values = change(column, _integers(crate[at + 8 : at + 8 + size], count))
        differences = np.diff(values, prepend=0).astype("<i4")
        plain = b"\0" * 4 + b"\xff" * ((2 * count + 7) // 8) + differences.tobytes()
        body += COUNT.pack(len(stored(plain))) + stored(plain)
        at += 8 + size
    return body


def checked(crate: bytes, change) -> None:
    """Check a crate with changed paths, laid behind it."""
    sections = read_sections(crate, "it", 0, len(crate))
    body = with_paths(crate, change)
    moved = [
        type(each)(each.name, len(crate), len(body)) if each.name == "PATHS" else each
        for each in sections
    ]
    check_paths(section_bodies(crate + body, 0, moved), "it")


NO_TREES = [
    (0, 3, 2, "twice"),
    (0, 3, 10**6, "out of its tables"),
    (1, 3, 10**6, "out of its tables"),
    (1, 3, -(10**6), "out of its tables"),
    (2, 0, 10**6, "out of itself"),
    (2, 0, -3, "out of itself"),
    (2, 1, 1, "no tree"),
    (2, 0, -2, "no tree"),
]


def test_paths_that_are_no_tree_are_refused(tmp_path: Path, random_gaussians):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(3))
    crate = path.read_bytes()
    checked(crate, lambda _, values: values)
    for column, place, value, message in NO_TREES:

        def change(which: int, values: np.ndarray, at=(column, place), value=value) -> np.ndarray:
            values = values.copy()
            if which == at[0]:
                values[at[1]] = value
            return values

        with pytest.raises(ValueError, match=message):
            checked(crate, change)


def test_a_file_whose_paths_are_no_tree_is_refused_before_the_library_follows_them(
    tmp_path: Path, random_gaussians
):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(3))
    crate = path.read_bytes()

    def change(column: int, values: np.ndarray) -> np.ndarray:
        # Every place leads to its child and, again, to it as a sibling: paths without end.
        return np.where(values == -1, 1, values) if column == 2 else values

    body = with_paths(crate, change)
    (table,) = struct.unpack_from("<q", crate, 16)
    sections = read_sections(crate, "it", 0, len(crate))
    number = [section.name for section in sections].index("PATHS")
    broken = bytearray(crate + body)
    SECTION.pack_into(broken, table + 8 + number * SECTION.size, b"PATHS", len(crate), len(body))
    path.write_bytes(broken)
    with pytest.raises(UsdError, match="is no tree"):
        read_gaussians(path)


def test_versions_with_other_tables_are_refused(tmp_path: Path, random_gaussians):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(3))
    crate = bytearray(path.read_bytes())
    crate[8:11] = 0, 3, 0
    path.write_bytes(crate)
    with pytest.raises(UsdError, match=r"version 0\.3\.0"):
        read_gaussians(path)


@pytest.mark.parametrize(
    ("suffix", "precision", "count"),
    [
        ("usdc", "float", 20_000),
        ("usdc", "mixed", 20_000),
        ("usdz", "half", 2),
    ],
)
def test_arrays_written_in_pieces_are_those_that_the_library_writes(
    tmp_path: Path, random_gaussians, suffix: str, precision, count: int
):
    from pxr import Usd

    from digs_warp.usd.author import author_field, begin_asset
    from digs_warp.usd.convert import WriteOptions, asset_arrays

    gaussians = random_gaussians(count, degree=1)
    options = WriteOptions(precision=precision)
    path, whole = tmp_path / f"pieces.{suffix}", str(tmp_path / "whole.usdc")
    write_gaussians(path, gaussians, {"a": 1}, options)
    stage = begin_asset({"a": 1})
    field = stage.DefinePrim("/Asset/Gaussians", "ParticleField3DGaussianSplat")
    author_field(field, asset_arrays(gaussians, options))
    stage.GetRootLayer().Export(whole)
    ours, theirs = Usd.Stage.Open(str(path)), Usd.Stage.Open(whole)
    properties = [
        (str(prim.GetPath()), each.GetName())
        for prim in theirs.TraverseAll()
        for each in prim.GetAuthoredAttributes()
    ]
    assert len(properties) > 15
    for prim, name in properties:
        found = ours.GetPrimAtPath(prim).GetAttribute(name)
        expected = theirs.GetPrimAtPath(prim).GetAttribute(name)
        assert found.GetTypeName() == expected.GetTypeName(), name
        # The mean color is summed up in another order.
        close = name == "primvars:displayColor"
        np.testing.assert_allclose(*numbers(found, expected), rtol=1e-6 if close else 0)
    assert ours.GetRootLayer().ExportToString().count(
        "\n"
    ) == theirs.GetRootLayer().ExportToString().count("\n")


def numbers(*attributes) -> list[np.ndarray]:
    """Values as numbers; texts by their bytes."""
    values = [attribute.Get() for attribute in attributes]
    if isinstance(values[0], str) or not np.issubdtype(np.asarray(values[0]).dtype, np.number):
        values = [list(str(value).encode()) for value in values]
    return [np.asarray(value) for value in values]


def test_the_splice_wants_each_array_once(tmp_path: Path, random_gaussians):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(3))
    with pytest.raises(ValueError, match="exactly once"):
        splice(path.read_bytes(), {"positions": np.full((1, 3), 12345.0, np.float32)}, {}, 2)


DAMAGE = {
    "version": ("_KNOWN_VERSIONS", ((0, 99, 0), (0, 99, 9))),
    "place of a value": ("_PLACE", np.uint64(0)),
    "empty table": ("read_values", lambda _fields, _what: (b"", np.zeros(0, np.uint64))),
}


@pytest.mark.parametrize(
    ("damage", "suffix"),
    [("version", "usdz"), ("place of a value", "usdc"), ("empty table", "usdc")],
)
def test_in_an_unknown_layout_the_library_writes_the_same_scene_itself(
    tmp_path: Path, random_gaussians, monkeypatch, caplog, damage: str, suffix: str
):
    gaussians, (name, value) = random_gaussians(2000), DAMAGE[damage]
    fast, slow = (tmp_path / f"{kind}.{suffix}" for kind in ("fast", "slow"))
    write_gaussians(fast, gaussians, {"a": 1})
    monkeypatch.setattr(writer, "_warned", False)
    monkeypatch.setattr(crate, name, value)
    write_gaussians(slow, gaussians, {"a": 1})
    write_gaussians(slow, gaussians, {"a": 1})
    monkeypatch.undo()
    assert [record.levelname for record in caplog.records] == ["WARNING"]  # once
    assert "new to digs_warp" in caplog.text
    assert differences(fast, slow) == []
    report = validate(slow)
    assert report.ok, report.text()
    assert describe(slow)["extent"] == describe(fast)["extent"]


def test_a_crate_of_another_layout_is_not_spliced(tmp_path: Path, random_gaussians):
    # The library itself writes an older layout on demand: lengths of arrays have 32 bits in it.
    random_gaussians(300).save(tmp_path / "gaussians.npz")
    program = (
        "import sys; from pathlib import Path\n"
        "from digs_warp.data.gaussians import Gaussians\n"
        "from digs_warp.usd.writer import write_gaussians\n"
        "write_gaussians(Path(sys.argv[2]), Gaussians.load(Path(sys.argv[1])))\n"
    )
    paths = [tmp_path / name for name in ("gaussians.npz", "old.usdc")]
    done = run_fresh(program, *paths, USD_WRITE_NEW_USDC_FILES_AS_VERSION="0.6.0")
    assert done.stderr.count("version 0.6.0 of the format") == 1
    write_gaussians(tmp_path / "new.usdc", random_gaussians(300))
    assert (tmp_path / "old.usdc").read_bytes()[8:11] == bytes([0, 6, 0])
    assert differences(tmp_path / "new.usdc", tmp_path / "old.usdc") == []


def test_bytes_do_not_depend_on_the_number_of_threads(
    tmp_path: Path, random_gaussians, monkeypatch
):
    gaussians = random_gaussians(20_000)
    files = []
    for threads in ("1", "2"):
        monkeypatch.setenv("DIGS_WARP_THREADS", threads)
        path = tmp_path / f"scene{threads}.usdc"
        write_gaussians(path, gaussians)
        files.append(path.read_bytes())
    assert files[0] == files[1]
