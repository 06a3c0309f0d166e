"""Broken and hostile files: a clear error, nothing lost, no crash, no memory blow-up."""

import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import Gaussians
from digs_warp.usd.capture_scene import CaptureScene, SceneVariant, write_capture_scene
from digs_warp.usd.files import HEADROOM, limited_memory
from digs_warp.usd.reader import read_gaussians
from digs_warp.usd.writer import write_gaussians
from reference import usd_mutator

# Values of another type than the schema's; children that a layer lists but does not hold.
ONCE_BAD = (1362, 2379, 2845, 4367, 6988, 7466)


def test_mutated_files_are_read_or_refused_but_never_hang_or_take_the_memory():
    # `python tests/reference/usd_mutator.py --count 10000` does the same at length.
    outcomes, bad = usd_mutator.run([*range(100), *ONCE_BAD])
    assert bad == []
    assert outcomes["read"] + outcomes["refused"] == 100 + len(ONCE_BAD)
    assert outcomes["read"] > 6
    assert outcomes["refused"] > 60


def write_one(path: Path, gaussians: Gaussians) -> None:
    write_capture_scene(path, CaptureScene((SceneVariant("a", gaussians),)))


def package(names: list[str], content: bytes = b"#usda 1.0\n", **options) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", **options) as archive:
        for name in names:
            archive.writestr(name, content)
    return buffer.getvalue()


BROKEN_FRAMES = [
    (package(["../evil.usda"]), r"'\.\./evil.usda' leads out"),
    (package(["/etc/evil.usda"]), "leads out"),
    (package(["C:\\evil.usda"]), "leads out"),
    (package(["a.usda", "a/../../b.usda"]), "leads out"),
    (package(["a.usda"], b"#usda 1.0\n" * 99, compression=zipfile.ZIP_DEFLATED), "compressed"),
    (
        package(["a.usdc"], b"PXR-USDC" + bytes(200)),
        "has version 0.0.0, expected 0.4.0 or later",
    ),
    (package(["a.usdc"], b"PXR-USDC\0\x08" + bytes(198)), "is at byte 0, expected 88 to 200"),
    (package(["a.usdc"], b"short"), "fewer than the header"),
    (package([])[:-4], "no directory"),
    (package(["a.usda"])[:-22] + b"PK\5\6" + b"\xff" * 18, "64-bit"),
]


def test_packages_with_a_broken_frame_are_refused(tmp_path: Path):
    path = tmp_path / "scene.usdz"
    for data, message in BROKEN_FRAMES:
        path.write_bytes(data)
        with pytest.raises(UsdError, match=message):
            read_gaussians(path)


def test_a_table_beyond_the_end_of_a_crate_is_refused(tmp_path: Path, random_gaussians):
    path = tmp_path / "scene.usdc"
    write_gaussians(path, random_gaussians(5))
    whole = path.read_bytes()
    for place, value, message in (
        (16, 2**40, r"table of the file is at byte"),
        (struct.unpack_from("<q", whole, 16)[0], 2**40, "sections"),
    ):
        broken = bytearray(whole)
        struct.pack_into("<q", broken, place, value)
        path.write_bytes(broken)
        with pytest.raises(UsdError, match=message):
            read_gaussians(path)


def test_memory_is_limited_while_a_file_is_read_and_free_afterwards():
    def allocate() -> None:
        np.empty(2 * HEADROOM, dtype=np.uint8)

    with limited_memory(1000):
        with pytest.raises(MemoryError):
            allocate()
        with limited_memory(1000):  # a second reader does not disturb the first
            pass
        with pytest.raises(MemoryError):
            allocate()
    allocate()


def test_large_files_may_take_memory_in_proportion():
    with limited_memory(HEADROOM // 8):
        np.empty(2 * HEADROOM, dtype=np.uint8)


@pytest.mark.parametrize("place", ["/proc/self/scene.usdz", "{tmp}/file/scene.usdz"])
@pytest.mark.parametrize("write", [write_gaussians, write_one])
def test_places_that_cannot_be_written_are_an_error_that_names_them(
    tmp_path: Path, random_gaussians, place: str, write
):
    (tmp_path / "file").write_bytes(b"no folder")
    path = Path(place.format(tmp=tmp_path))
    with pytest.raises(UsdError, match=r"scene\.usdz': cannot be written"):
        write(path, random_gaussians(2))
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]
