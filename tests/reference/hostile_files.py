"""Small files that promise a lot: made, then read in one fresh process that measures memory and time.

    python tests/reference/hostile_files.py FOLDER

prints a line of JSON for each case: its name, the error's message, the growth in memory [MB], seconds.
"""

import json
import math
import struct
import sys
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]

Make = Callable[[Path], object]
Read = Callable[[Path], object]


def png(width: int, height: int) -> bytes:
    """A black PNG of one bit per pixel: readers make at least a byte of it."""
    rows = zlib.compress(bytes((1 + width // 8) * height), 1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        checksum = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", checksum)

    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


def npy_header(shape: tuple[int, ...]) -> bytes:
    """The header of an array of float32."""
    text = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


def npz(path: Path, rows: int) -> None:
    """Gaussians that are all zero, compressed a thousandfold."""
    from digs_warp.data.gaussians import FIELDS

    columns = dict.fromkeys(FIELDS, (3,)) | {"quats": (4,), "opacity_logits": (), "sh": (16, 3)}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, shape in columns.items():
            with archive.open(f"{name}.npy", "w") as file:
                file.write(npy_header((rows, *shape)))
                for _ in range(rows // 10_000):
                    file.write(bytes(4 * 10_000 * math.prod(shape)))


def long_file(path: Path, size: int, start: bytes = b"") -> None:
    """A file of zeros that takes no space on the disk."""
    with path.open("wb") as file:
        file.write(start)
        file.truncate(size)


def glb(header: dict[str, object], binary: bytes = bytes(64), depth: int = 0) -> bytes:
    """A GLB file of one mesh, with the fields of ``header`` on top."""
    base = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": len(binary)}],
    }
    nested = b', "extras": ' + b"[" * depth + b"0" + b"]" * depth + b"}"
    text = json.dumps(base | header).encode()[:-1] + nested
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def textured_glb(image: bytes) -> bytes:
    """One triangle with a texture."""
    import numpy as np

    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    binary = points.tobytes() + points[:, :2].tobytes() + image
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    return glb(
        {
            "meshes": [{"primitives": [{"attributes": attributes, "material": 0}]}],
            "accessors": [
                {"componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0},
                {"componentType": 5126, "type": "VEC2", "count": 3, "bufferView": 1},
            ],
            "bufferViews": [
                {"buffer": 0, "byteLength": 36},
                {"buffer": 0, "byteOffset": 36, "byteLength": 24},
                {"buffer": 0, "byteOffset": 60, "byteLength": len(image)},
            ],
            "images": [{"bufferView": 2, "mimeType": "image/png"}],
            "textures": [{"source": 0}],
            "materials": [
                {"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
            ],
        },
        binary + bytes(-len(binary) % 4),
    )


def _accessor(**fields: object) -> dict[str, object]:
    return {"accessors": [{"componentType": 5126, "type": "VEC3", "count": 3} | fields]}


MESHES = {
    "zeros.glb": glb(
        {
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {"componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0},
                {"componentType": 5125, "type": "SCALAR", "count": 90_000_000},
            ],
        }
    ),
    "many_zeros.glb": glb({"accessors": _accessor(count=100_000)["accessors"] * 1000}),  # type: ignore[operator]
    "sparse.glb": glb(_accessor(count=3, sparse={"count": 100_000_000})),
    "view.glb": glb(_accessor(count=100_000_000, bufferView=0)),
    "buffer.glb": glb(
        _accessor(count=100_000_000, bufferView=0)
        | {
            "bufferViews": [{"buffer": 0, "byteLength": 1_200_000_000}],
            "buffers": [{"byteLength": 1_200_000_000}],
        }
    ),
    "copies.glb": glb(
        _accessor(count=100_000, bufferView=0)
        | {
            "bufferViews": [{"buffer": 0, "byteLength": 1_200_000}],
            "nodes": [{"mesh": 0}] * 900,
            "scenes": [{"nodes": list(range(900))}],
        },
        bytes(1_200_000),
    ),
    "deep.glb": glb({}, depth=100_000),
    "vertices.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 900000000\n"
    b"property float x\nproperty float y\nproperty float z\nend_header\n" + bytes(99),
    "faces.ply": b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 30000000\nproperty list uchar int vertex_indices\nend_header\n"
    b"0 0 0\n",
    "count.stl": bytes(80) + struct.pack("<I", 4_000_000_000) + bytes(500),
}


def spz(count: int) -> bytes:
    """Equal Gaussians, compressed a thousandfold."""
    header = struct.pack("<IIIBBBB", 0x5053474E, 3, count, 3, 12, 0, 0)
    packer = zlib.compressobj(1, zlib.DEFLATED, 31)
    pieces = [packer.compress(header)]
    pieces += [packer.compress(bytes(65 * 10_000)) for _ in range(count // 10_000)]
    return b"".join([*pieces, packer.flush()])


def capture_with(path: Path, layer: str) -> None:
    """A capture of three frames, one file of which is replaced by a huge image."""
    import numpy as np

    from digs_warp.data.capture_writer import CaptureWriter, FrameImages
    from digs_warp.geometry.camera import Intrinsics

    writer = CaptureWriter(path, Intrinsics(8, 4, 8.0, 8.0, 4.0, 2.0), None)
    images = FrameImages(
        image=np.zeros((4, 8, 3), np.uint8),
        depth=np.ones((4, 8), np.float32),
        mask=np.zeros((4, 8), np.uint8),
    )
    for number in range(2):
        writer.write_frame(number, images)
        writer.add_pose(number, np.eye(4), float(number))
    writer.finish()
    target = min((path / layer).iterdir())
    target.write_bytes(png(40_000, 20_000))


def _cases() -> dict[str, tuple[Make, Read]]:
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

    def settings(path: Path) -> object:
        return read_defaults(Simulate, path)

    def first(load: str) -> Read:
        return lambda path: getattr(read_capture(path).frames[0], load)()

    deep = 200_000
    aliases = "a: &a [x, x]\n" + "".join(
        f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]\n" for i in range(24)
    )
    meshes: dict[str, tuple[Make, Read]] = {
        name: (lambda p, data=data: p.write_bytes(data), load_scene)
        for name, data in MESHES.items()
    }
    return meshes | {
        "bomb.spz": (lambda p: p.write_bytes(spz(10_000_000)), read_spz),
        "texture.glb": (
            lambda p: p.write_bytes(textured_glb(png(12_000, 12_000))),
            load_scene,
        ),
        "environment.png": (lambda p: p.write_bytes(png(40_000, 20_000)), load_environment),
        "environment.hdr": (
            lambda p: p.write_bytes(
                b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 30000 +X 60000\n" + bytes(9)
            ),
            load_environment,
        ),
        "photo": (lambda p: capture_with(p, "images"), first("load_image")),
        "depth": (lambda p: capture_with(p, "depth"), first("load_depth")),
        "mask": (lambda p: capture_with(p, "masks"), first("load_mask")),
        "mask.png": (lambda p: p.write_bytes(png(40_000, 20_000)), lambda p: read_image(p, "mask")),
        "bomb.npz": (lambda p: npz(p, 3_000_000), Gaussians.load),
        "depth.npy": (
            lambda p: p.write_bytes(npy_header((100_000, 100_000))),
            lambda p: read_image(p, "depth"),
        ),
        "long.json": (lambda p: long_file(p, 1 << 32), lambda p: read_json(p, "index")),
        "deep.json": (
            lambda p: p.write_text('{"a": ' + "[" * deep),
            lambda p: read_json(p, "index"),
        ),
        "poses.txt": (lambda p: long_file(p, 1 << 32), lambda p: read_numbers(p, (-1, 8), "poses")),
        "long.yaml": (lambda p: long_file(p, 1 << 32), load_profile),
        "deep.yaml": (lambda p: p.write_text("figures: " + "[" * deep), load_profile),
        "aliases.yaml": (lambda p: p.write_text(aliases), load_profile),
        "settings.yaml": (lambda p: p.write_text("settings: " + "{a: " * deep), settings),
    }


def make_all(folder: Path) -> None:
    """Write every file."""
    for name, (make, _) in _cases().items():
        make(folder / name)


def read_all(folder: Path) -> None:
    """Read every file and print what came of it."""
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


if __name__ == "__main__":
    # The repository's root ahead of tests/, whose digs_warp folder would shadow the package.
    sys.path[:0] = [str(REPOSITORY), str(REPOSITORY / "tests")]
    read_all(Path(sys.argv[1]))
