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


def capture_with(path: Path, layer: str) -> None:
    """A capture of three frames, one file of which is replaced by a huge image."""
    import numpy as np

    from digs_warp.camera import Intrinsics
    from digs_warp.data.capture_writer import CaptureWriter, FrameImages

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
    from digs_warp.interchange.captures.recorded_files import read_numbers
    from digs_warp.interchange.captures.to_capture import load_depth
    from digs_warp.record.files import read_json
    from digs_warp.sim.environment import load_environment
    from digs_warp.sim.profiles import load_profile

    def settings(path: Path) -> object:
        return read_defaults(Simulate, path)

    def first(load: str) -> Read:
        return lambda path: getattr(read_capture(path).frames[0], load)()

    deep = 200_000
    aliases = "a: &a [x, x]\n" + "".join(
        f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]\n" for i in range(24)
    )
    return {
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
            lambda p: load_depth(p, 1.0),
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
