"""Mutated USD files, seeded: does reading one crash, hang, or take all the memory?

    python tests/reference/usd_mutator.py --count 5000

Files are read in worker processes, because a fault in the C++ library ends the process. A worker says which
file it is at; where it dies, the next one goes on behind that file.
"""

import argparse
import json
import random
import resource
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
SECONDS_PER_FILE = 20
MEMORY = (
    4 << 30
)  # address space of a worker; the interpreter and its libraries map about half of it
INTEGERS = (0, 1, 0x7F, 0xFF, 2**16, 2**31 - 1, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**64 - 1)


def mutate(data: bytes, seed: int) -> bytes:
    """Return ``data`` with one to four faults of the kinds that disks, networks and enemies make."""
    rng = random.Random(seed)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(_FAULTS)(data, rng)
    return data


def _flip_bits(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice((1, 2, 8, 64))):
        if out:
            out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def _truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _overwrite_integer(data: bytes, rng: random.Random) -> bytes:
    size = rng.choice((1, 2, 4, 8))
    value = (rng.choice(INTEGERS) % 256**size).to_bytes(size, "little")
    at = _place(data, rng)
    return data[:at] + value + data[at + size :]


def _delete(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + data[at + rng.choice((1, 4, 64, 1000)) :]


def _copy_over(data: bytes, rng: random.Random) -> bytes:
    source, target, size = _place(data, rng), _place(data, rng), rng.choice((4, 16, 256))
    piece = data[source : source + size]
    return data[:target] + piece + data[target + len(piece) :]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + rng.randbytes(rng.choice((1, 4, 64))) + data[at:]


def _replace_number(data: bytes, rng: random.Random) -> bytes:
    """In text: one run of digits becomes something else."""
    digits = [i for i, byte in enumerate(data) if 48 <= byte < 58]
    if not digits:
        return _flip_bits(data, rng)
    at = rng.choice(digits)
    new = rng.choice((b"nan", b"-1", b"1e999", b"99999999999", b"(", b"[", b"{", b'"', b"@x@", b""))
    return data[:at] + new + data[at + 1 :]


def _place(data: bytes, rng: random.Random) -> int:
    """Headers and the ends of files, where the tables are, are hit more often than the numbers."""
    size = len(data)
    if not size:
        return 0
    return rng.choice(
        (rng.randrange(size), rng.randrange(min(size, 256)), max(0, size - 1 - rng.randrange(1500)))
    )


_FAULTS = (
    _flip_bits,
    _truncate,
    _overwrite_integer,
    _overwrite_integer,
    _delete,
    _copy_over,
    _insert,
    _replace_number,
)


def make_originals(folder: Path) -> list[Path]:
    """Write one scene in every format and precision, one by the library alone, and a capture package."""
    from digs_warp.usd.author import author_field, begin_asset
    from digs_warp.usd.capture_scene import write_capture_scene
    from digs_warp.usd.convert import WriteOptions, asset_arrays
    from digs_warp.usd.writer import write_gaussians
    from reference.capture_scenes import full_scene, splats

    paths = []
    for suffix in ("usda", "usdc", "usdz"):
        for precision in ("float", "half"):
            path = folder / f"{precision}.{suffix}"
            write_gaussians(path, splats(8), {"a": [1, 2]}, WriteOptions(precision=precision))
            paths.append(path)
    stage = begin_asset({"a": [1, 2]})
    field = stage.DefinePrim("/Asset/Gaussians", "ParticleField3DGaussianSplat")
    author_field(field, asset_arrays(splats(8), WriteOptions()))
    stage.GetRootLayer().Export(str(folder / "library.usdc"))
    write_capture_scene(folder / "capture.usdz", full_scene(8))
    return [*paths, folder / "library.usdc", folder / "capture.usdz"]


def work(folder: Path, numbers: list[int]) -> None:
    """Read the mutated files of these numbers; print a line before and after each."""
    from digs_warp.checks import DigsError
    from digs_warp.usd.reader import describe, read_gaussians
    from digs_warp.usd.validate import validate

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    originals = make_originals(folder)
    for original in originals:  # what is refused below, is refused for its faults
        read_gaussians(original)
        assert validate(original).ok
    for number in numbers:
        original = originals[number % len(originals)]
        path = folder / f"mutated{number}{original.suffix}"
        path.write_bytes(mutate(original.read_bytes(), number))
        _say(str(number))
        Path("/proc/self/clear_refs").write_text("5")  # forget the peak of the files before
        signal.alarm(SECONDS_PER_FILE)
        try:
            read_gaussians(path)
            describe(path)
            validate(path)
            outcome = "read"
        except DigsError:
            outcome = "refused"
        except MemoryError:
            outcome = "memory"
        except Exception as error:
            outcome = f"unexpected {type(error).__name__}: {error}"
        signal.alarm(0)
        path.unlink()
        peak = _peak_megabytes()
        _say(json.dumps([number, outcome, peak]))


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def _peak_megabytes() -> int:
    """The most memory that this process held since the peak was last forgotten."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) // 1024


def run(numbers: Sequence[int]) -> tuple[Counter[str], list[str]]:
    """Return how often each outcome came, and a line for each file that ended badly."""
    outcomes: Counter[str] = Counter()
    bad: list[str] = []
    left = list(numbers)
    while left:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, __file__, "--work", folder, json.dumps(left)]
            done = subprocess.run(
                command, capture_output=True, text=True, errors="replace", check=False
            )
        lines = done.stdout.splitlines()
        reports = [json.loads(line) for line in lines if line.startswith("[")]
        for number, outcome, peak in reports:
            outcomes[outcome.split()[0]] += 1
            if outcome not in ("read", "refused") or peak > 1024:
                bad.append(f"file {number}: {outcome}, peak {peak} MB")
        started = [int(line) for line in lines if not line.startswith("[")]
        if not started:
            raise RuntimeError(f"the worker did not start: {done.stderr[-2000:]}")
        if len(started) > len(reports):
            why = "hang" if done.returncode == -signal.SIGALRM else f"died ({done.returncode})"
            outcomes[why.split()[0]] += 1
            bad.append(f"file {started[-1]}: {why}: {done.stderr[-300:]}")
        left = left[left.index(started[-1]) + 1 :]
    return outcomes, bad


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--work", nargs=2, metavar=("FOLDER", "NUMBERS"))
    arguments = parser.parse_args()
    if arguments.work:
        folder, numbers = arguments.work
        work(Path(folder), json.loads(numbers))
        return
    outcomes, bad = run(range(arguments.first, arguments.count))
    _say("\n".join([str(dict(outcomes)), *bad]))


if __name__ == "__main__":
    # The repository's root ahead of tests/, whose digs_warp folder would shadow the package.
    sys.path[:0] = [str(REPOSITORY), str(REPOSITORY / "tests")]
    main()
