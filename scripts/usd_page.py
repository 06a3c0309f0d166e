"""Measure USD scenes and write the figures into docs/usd.md, between its two marks.

Usage: python scripts/usd_page.py   (about two minutes; keep the machine quiet meanwhile)
"""

from page_marks import fill

from digs_warp.record.progress import show_progress
from digs_warp.record.run_log import versions
from digs_warp.study.bench_usd import PICTURED_SPLATS, SPLATS, bench_usd
from digs_warp.study.machine import processor
from digs_warp.study.results import Result, format_number

_COLUMNS = (
    "write",
    "np.save",
    "read",
    "np.load",
    "validate",
    "write memory",
    "read memory",
    "size",
    "PSNR",
)

TEXT = """Times are for {splats:,} splats of degree 3: from memory to a new file, back to Gaussians, and
validation with our rules and those of OpenUSD; np.save and np.load are what NumPy takes for as many bytes
as they are. Memory is the peak beyond what a fresh process held before, mapped files included. PSNR is that
of pictures of {pictured:,} splats that were written, read and rendered, against pictures of the original
(120 dB: no difference). Measured on
{machine}, Python {python}, usd-core {usd}.

{table}
"""


def main() -> None:
    """Measure and write."""
    show_progress()
    found = versions()
    figures = TEXT.format(
        splats=SPLATS,
        pictured=PICTURED_SPLATS,
        machine=processor(),
        python=found["python"],
        usd=found["usd-core"],
        table=precision_table(bench_usd()),
    )
    print(fill("digs_warp.usd.md", "figures", figures))  # noqa: T201 (a script)


def precision_table(results: list[Result]) -> str:
    """Return the Markdown table: a row for every precision and format."""
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for result in results:
        row = rows.setdefault((result.settings["precision"], result.settings["format"]), {})
        row[result.name] = f"{format_number(result.value)} {result.unit}"
    measured = rows["float", "usdc"]
    columns = [name for name in _COLUMNS if name in measured]
    lines = [
        "| precision | format | " + " | ".join(columns) + " |",
        "|---" * (2 + len(columns)) + "|",
    ]
    lines += [
        f"| {precision} | .{suffix} | " + " | ".join(row[name] for name in columns) + " |"
        for (precision, suffix), row in rows.items()
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
