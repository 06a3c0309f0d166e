"""Small files that promise a lot: made, and read by a fresh process that measures memory and time."""

import json
import math
import struct
import time
import zipfile
import zlib
from collections.abc import Callable
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np

from reference.gltf_builder import GltfBuilder, glb_bytes
from reference.noise_capture import write_capture

Content = bytes | int | Callable[[Path], object]  # what to write, so many zeros, or what writes it
Read = Callable[[Path], object]


def png(width: int, height: int) -> bytes:
    """A black PNG of one bit per pixel: readers make at least a byte of it."""
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(bytes((1 + width // 8) * height), 1)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


def npy_header(shape: tuple[int, ...]) -> bytes:
    """The header of an array of float32."""
    file = BytesIO()
    kind = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, kind)
    return file.getvalue()


def npz(path: Path, rows: int = 3_000_000) -> None:
    """Gaussians that are all zero, compressed a thousandfold."""
    from digs_warp.data.gaussians import FIELDS

    columns = dict.fromkeys(FIELDS, (3,)) | {"quats": (4,), "opacity_logits": (), "sh": (16, 3)}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, shape in columns.items():
            with archive.open(f"{name}.npy", "w") as file:
                file.write(npy_header((rows, *shape)))
                for _ in range(rows // 10_000):
                    file.write(bytes(4 * 10_000 * math.prod(shape)))


def spz(count: int) -> bytes:
    """Equal Gaussians, compressed a thousandfold."""
    packer = zlib.compressobj(1, zlib.DEFLATED, 31)
    pieces = [packer.compress(struct.pack("<IIIBBBB", 0x5053474E, 3, count, 3, 12, 0, 0))]
    pieces += [packer.compress(bytes(65 * 10_000)) for _ in range(count // 10_000)]
    return b"".join([*pieces, packer.flush()])


POINTS = {"componentType": 5126, "type": "VEC3", "count": 3}


def glb(binary: bytes = bytes(64), depth: int = 0, size: int = 36, **header: object) -> bytes:
    """A GLB file of one mesh whose only view has a size, with the fields of ``header`` on top."""
    base = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [POINTS | {"bufferView": 0}],
        "bufferViews": [{"buffer": 0, "byteLength": size}],
        "buffers": [{"byteLength": len(binary)}],
    }
    nested = b', "extras": ' + b"[" * depth + b"0" + b"]" * depth + b"}"
    return glb_bytes(json.dumps(base | header).encode()[:-1] + nested, binary)


MANY = POINTS | {"bufferView": 0, "count": 100_000_000}
INDICES = {"componentType": 5125, "type": "SCALAR", "count": 90_000_000}
INDEXED = {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}
XYZ = b"property float x\nproperty float y\nproperty float z\n"

MESHES = {
    "zeros.glb": glb(meshes=[INDEXED], accessors=[POINTS | {"bufferView": 0}, INDICES]),
    "many_zeros.glb": glb(accessors=[POINTS | {"count": 100_000}] * 1000),
    "sparse.glb": glb(accessors=[POINTS | {"sparse": {"count": 100_000_000}}]),
    "view.glb": glb(accessors=[MANY]),
    "buffer.glb": glb(
        accessors=[MANY], size=1_200_000_000, buffers=[{"byteLength": 1_200_000_000}]
    ),
    "copies.glb": glb(
        bytes(1_200_000),
        size=1_200_000,
        accessors=[MANY | {"count": 100_000}],
        nodes=[{"mesh": 0}] * 900,
        scenes=[{"nodes": list(range(900))}],
    ),
    "deep.glb": glb(depth=100_000),
    "vertices.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 900000000\n"
    + XYZ
    + b"end_header\n"
    + bytes(99),
    "faces.ply": b"ply\nformat ascii 1.0\nelement vertex 1\n"
    + XYZ
    + b"element face 30000000\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n",
    "count.stl": bytes(80) + struct.pack("<I", 4_000_000_000) + bytes(500),
}


def textured_glb(path: Path) -> None:
    """A rectangle with a large texture."""
    builder = GltfBuilder()
    view = builder.view(png(12_000, 12_000))
    builder.header["images"] = [{"bufferView": view, "mimeType": "image/png"}]
    builder.header["textures"] = [{"source": 0}]
    builder.material["name"] = "paint"
    builder.material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    builder.save(path)


def _cases() -> dict[str, tuple[Content, Read]]:
    from digs_warp.commands.settings_file import read_defaults
    from digs_warp.commands.simulate import Simulate
    from digs_warp.data.capture import read_capture
    from digs_warp.data.gaussians import Gaussians
    from digs_warp.data.images import read_image
    from digs_warp.formats.captures.recording import read_numbers
    from digs_warp.formats.splats.spz import read_spz
    from digs_warp.record.files import read_json
    from digs_warp.sim.camera.profiles import load_profile
    from digs_warp.sim.scene.environment import load_environment
    from digs_warp.sim.scene.load import load_scene

    huge, deep, long = png(40_000, 20_000), 200_000, 1 << 32

    def capture_with(layer: str, load: str) -> tuple[Content, Read]:
        """A capture one of whose files is a huge image."""

        def make(path: Path) -> None:
            write_capture(path)
            min((path / layer).iterdir()).write_bytes(huge)

        return make, lambda path: getattr(read_capture(path).frames[0], load)()

    letters = [chr(97 + i) for i in range(25)]
    aliases = "a: &a [x, x]\n" + "".join(
        f"{new}: &{new} [*{old}, *{old}]\n" for old, new in pairwise(letters)
    )
    meshes: dict[str, tuple[Content, Read]] = {n: (data, load_scene) for n, data in MESHES.items()}
    return meshes | {
        "bomb.spz": (spz(10_000_000), read_spz),
        "texture.glb": (textured_glb, load_scene),
        "environment.png": (huge, load_environment),
        "environment.hdr": (
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 30000 +X 60000\n" + bytes(9),
            load_environment,
        ),
        "photo": capture_with("images", "load_image"),
        "depth": capture_with("depth", "load_depth"),
        "mask": capture_with("masks", "load_mask"),
        "mask.png": (huge, lambda p: read_image(p, "mask")),
        "bomb.npz": (npz, Gaussians.load),
        "depth.npy": (npy_header((100_000, 100_000)), lambda p: read_image(p, "depth")),
        "long.json": (long, lambda p: read_json(p, "index")),
        "deep.json": (b'{"a": ' + b"[" * deep, lambda p: read_json(p, "index")),
        "poses.txt": (long, lambda p: read_numbers(p, (-1, 8), "poses")),
        "long.yaml": (long, load_profile),
        "deep.yaml": (b"figures: " + b"[" * deep, load_profile),
        "aliases.yaml": (aliases.encode(), load_profile),
        "settings.yaml": (b"settings: " + b"{a: " * deep, lambda p: read_defaults(Simulate, p)),
    }


def make_all(folder: Path) -> None:
    """Write every file; zeros take no space on the disk."""
    for name, (content, _) in _cases().items():
        if isinstance(content, bytes):
            (folder / name).write_bytes(content)
        elif isinstance(content, int):
            with (folder / name).open("wb") as file:
                file.truncate(content)
        else:
            content(folder / name)


def read_all(folder: Path) -> None:
    """Read every file; print its name, the error's message, the growth in memory [MB], and seconds."""
    from digs_warp.checks import DigsError

    for name, (_, read) in _cases().items():
        Path("/proc/self/clear_refs").write_text("5")  # forget the peak of the files before
        before, start = _megabytes("VmRSS"), time.perf_counter()
        try:
            read(folder / name)
            message = "read"
        except DigsError as error:
            message = str(error)
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
        seconds = round(time.perf_counter() - start, 2)
        print(json.dumps([name, message[:500], _megabytes("VmHWM") - before, seconds]))  # noqa: T201


def _megabytes(name: str) -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{name}:")[1].split()[0]) // 1024
