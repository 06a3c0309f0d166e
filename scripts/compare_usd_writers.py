"""Write the same Gaussians with NVIDIA's usd-convert-gsplat and with this package, in one run; print a table.

    python -m venv /tmp/other && /tmp/other/bin/pip install usd-convert-gsplat usd-core
    python scripts/compare_usd_writers.py /tmp/other/bin/usd-convert-gsplat --splats 100000

The other program pins its own NumPy and reads a PLY, so it runs in its own environment; its time contains its
start and the reading of the PLY, and so does ours, started as a process of its own. Our reader then reads
both files, and the greatest differences between them are printed. With --page the table also goes into
docs/usd.md, between its two marks.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from page_marks import fill

from digs_warp.interchange.splats.files import write_splat_file
from digs_warp.study.bench_usd import random_splats
from digs_warp.study.machine import processor
from digs_warp.study.results import Result, format_number, format_table
from digs_warp.usd.diff import differences


def seconds(command: list[str]) -> float:
    """Run a command and return how long it took."""
    start = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - start


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("converter", help="the program usd-convert-gsplat of its own environment")
    parser.add_argument("--splats", type=int, default=100_000)
    parser.add_argument("--page", action="store_true", help="also write the table into docs/usd.md")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        ply, theirs, ours = (Path(folder) / name for name in ("a.ply", "theirs.usdc", "ours.usdc"))
        write_splat_file(ply, random_splats(arguments.splats))
        ours_command = [
            sys.executable,
            "-c",
            "import sys; from digs_warp.cli import main; sys.exit(main())",
        ]
        commands = {
            "usd-convert-gsplat": [arguments.converter, "-i", str(ply), "-o", str(theirs)],
            "digs-warp convert": [*ours_command, "convert", str(ply), str(ours), "--up", "y"],
        }
        results = []
        for (name, command), path in zip(commands.items(), (theirs, ours), strict=True):
            case = {"program": name, "splats": arguments.splats}
            results.append(Result("PLY to USD", seconds(command), "s", case))
            results.append(Result("size", path.stat().st_size / 1e6, "MB", case))
        lines = [format_table(results), "", "differences of the two files:"]
        lines += [f"  {line}" for line in differences(ours, theirs)]
    sys.stdout.write("\n".join(lines) + "\n")
    if arguments.page:
        write_page(results, arguments.splats)


def write_page(results: list[Result], splats: int) -> None:
    """Write the Markdown table into the page."""
    rows: dict[str, dict[str, str]] = {}
    for result in results:
        row = rows.setdefault(result.settings["program"], {})
        row[result.name] = f"{format_number(result.value)} {result.unit}"
    lines = [
        f"A PLY of {splats:,} splats of degree 3 to `.usdc`, start of the program included, in one run on",
        f"{processor()}:",
        "",
        "| program | time | size |",
        "|---|---|---|",
        *(f"| {name} | {row['PLY to USD']} | {row['size']} |" for name, row in rows.items()),
    ]
    fill("digs_warp.usd.md", "comparison", "\n".join(lines))


if __name__ == "__main__":
    main()
