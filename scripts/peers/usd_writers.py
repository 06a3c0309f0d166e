"""Write the same Gaussians with NVIDIA's usd-convert-gsplat and with this package, in one run; print a table.

    python -m venv /tmp/other && /tmp/other/bin/pip install usd-convert-gsplat usd-core
    python -m scripts.peers.usd_writers /tmp/other/bin/usd-convert-gsplat --splats 100000

The other program pins its own NumPy and reads a PLY, so it runs in its own environment; its time contains its
start and the reading of the PLY, and so does ours, started as a separate process. Our reader then reads
both files, and the greatest difference of positions is printed.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from digs_warp.formats.splats.files import write_splat_file
from digs_warp.study.scenes import processor
from digs_warp.usd.reader import read_gaussians
from scripts.peers.splat_transform import random_splats
from studies.results import Result, format_tables
from studies.timing import Stopwatch


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("converter", help="usd-convert-gsplat in its own environment")
    parser.add_argument("--splats", type=int, default=100_000)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        ply, theirs, ours = (Path(folder) / name for name in ("a.ply", "theirs.usdc", "ours.usdc"))
        write_splat_file(ply, random_splats(arguments.splats))
        convert = [sys.executable, "-m", "digs_warp", "convert"]
        programs = {
            "usd-convert-gsplat": (
                [arguments.converter, "-i", str(ply), "-o", str(theirs)],
                theirs,
            ),
            "digs-warp convert": ([*convert, str(ply), "--out", str(ours), "--up", "y"], ours),
        }
        results = []
        for name, (command, path) in programs.items():
            with Stopwatch() as watch:
                subprocess.run(command, check=True, capture_output=True)
            labels = {"program": name, "splats": arguments.splats, "machine": processor()}
            values = {"time [s]": watch.seconds, "size [MB]": path.stat().st_size / 1e6}
            results.append(Result(labels, values))
        apart = read_gaussians(ours).means - read_gaussians(theirs).means
        lines = [
            format_tables(results),
            "",
            f"positions differ by up to {np.abs(apart).max():.3g} m",
        ]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
