"""Damaged splat files without end: each must give Gaussians or a `DigsError`, in little time and memory.

    python tests/reference/fuzz_splats.py 6000

The damage follows from the seed. Prints the outcomes by format; a crash or memory beyond the limit ends it
with the number of the file, which `--only NUMBER` makes again.
"""

import argparse
import gzip
import logging
import re
import resource
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.formats.splats.files import (
    WRITABLE,
    SplatWriting,
    read_splat_file,
    write_splat_file,
)

MEMORY_LIMIT = 1 << 30  # [bytes] beyond what the imports take
NUMBERS = (b"0", b"-1", b"1000000000000", b"4294967296", b"99999999999999999999", b"1e9", b"nan")


def originals(folder: Path) -> list[Path]:
    """Healthy files of every format, version and degree, small and larger."""
    rng = np.random.default_rng(0)
    files = []
    for count, degree in ((1, 0), (4, 3), (60, 1)):
        g = Gaussians(
            means=rng.normal(size=(count, 3)),
            log_scales=rng.uniform(-6, 0, (count, 3)),
            quats=rng.normal(size=(count, 4)),
            opacity_logits=rng.normal(size=count),
            sh=rng.normal(size=(count, (degree + 1) ** 2, 3)),
        )
        names = [f"a{suffix}" for suffix in WRITABLE if suffix != ".spz"]
        names += ["v2.spz", "v3.spz", "v4.spz"]
        for name in names:
            path = folder / f"{count}-{name}"
            version = int(name[1]) if name.startswith("v") else 3
            write_splat_file(path, g, SplatWriting(spz_version=version))
            files.append(path)
        files.append(_as_text(folder / f"{count}-a.ply", len(g)))
        g.save(folder / f"{count}-ours.npz")
        files.append(folder / f"{count}-ours.npz")
        # A gzip stream hides the payload from bit flips behind its checksum: without it they get through.
        plain = folder / f"{count}-plain.spz"
        plain.write_bytes(gzip.decompress((folder / f"{count}-v3.spz").read_bytes()))
        files.append(plain)
    return files


def _as_text(path: Path, count: int) -> Path:
    header, _, body = path.read_bytes().partition(b"end_header\n")
    rows = np.frombuffer(body, "<f4").reshape(count, -1)
    text = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in rows)
    target = path.with_name(f"text-{path.name}")
    header = header.replace(b"binary_little_endian", b"ascii") + b"end_header\n"
    target.write_bytes(header + text.encode() + b"\n")
    return target


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Return ``data`` with one to three injuries."""
    for _ in range(rng.integers(1, 4)):
        data = _injured(data, rng)
    return data


def _injured(data: bytes, rng: np.random.Generator) -> bytes:
    if not data:
        return bytes(rng.integers(0, 256, 40, dtype=np.uint8))
    changed = bytearray(data)
    # Half of all injuries hit the first bytes, where the headers are.
    reach = len(data) if rng.random() < 0.5 else min(len(data), 48)
    place = int(rng.integers(reach))
    kind = rng.integers(8)
    if kind == 0:
        changed[place] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        changed[place] = int(rng.choice([0, 1, 127, 128, 255]))
    elif kind == 2:
        del changed[place:]
    elif kind == 3:
        del changed[place : place + int(rng.integers(1, 64))]
    elif kind == 4:
        changed[place:place] = rng.integers(
            0, 256, int(rng.integers(1, 64)), dtype=np.uint8
        ).tobytes()
    elif kind == 5:
        other = int(rng.integers(len(data)))
        changed[place : place + 32] = data[other : other + 32]
    elif kind == 6:
        extreme = rng.choice([np.nan, np.inf, -np.inf, 3e38, -1e-40]).astype("<f4")
        changed[place : place + 4] = extreme.tobytes()
    else:  # another number somewhere in a text header, or a large one in a binary one
        found = list(re.finditer(rb"\b\d+\b", data[:4096]))
        if found and data.startswith(b"ply"):
            spot = found[int(rng.integers(len(found)))]
            changed[spot.start() : spot.end()] = NUMBERS[int(rng.integers(len(NUMBERS)))]
        else:
            size = int(rng.choice([4, 8]))
            changed[place : place + size] = b"\xff" * size
    return bytes(changed)


def outcome(path: Path) -> str:
    """Read ``path`` both ways and say how it ended; everything but the two good ends is raised."""
    if path.suffix == ".npz":
        try:
            Gaussians.load(path)
        except DigsError:
            return "refused"
        return "read"
    ends = []
    for drop in (False, True):
        try:
            g = read_splat_file(path, drop_broken=drop)
        except DigsError as error:
            assert str(path) in str(error), f"the message does not name the file: {error}"
            ends.append("refused")
        else:
            assert all(np.isfinite(getattr(g, name)).all() for name in FIELDS)
            ends.append("read")
    return " / ".join(ends)


def main() -> None:
    """Damage files and read them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int)
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    counts: Counter[tuple[str, str]] = Counter()
    slowest = 0.0
    with tempfile.TemporaryDirectory() as name:
        files = originals(Path(name))
        # Address space, not memory in use: what is asked for and never touched counts, too.
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_LIMIT, used + MEMORY_LIMIT))
        for number in range(options.count) if options.only is None else [options.only]:
            rng = np.random.default_rng([options.seed, number])
            original = files[int(rng.integers(len(files)))]
            path = original.with_name(f"damaged{original.suffix}")
            path.write_bytes(damaged(original.read_bytes(), rng))
            start = time.perf_counter()
            try:
                counts[original.suffix, outcome(path)] += 1
            except BaseException as error:
                error.add_note(
                    f"damaged file {number} of seed {options.seed}, from {original.name}"
                )
                raise
            slowest = max(slowest, time.perf_counter() - start)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before
    for (suffix, end), count in sorted(counts.items()):
        sys.stdout.write(f"{suffix:7} {end:18} {count}\n")
    sys.stdout.write(
        f"{counts.total()} files, slowest {1e3 * slowest:.0f} ms, {grown / 1e6:.0f} MB at most\n"
    )


if __name__ == "__main__":
    main()
