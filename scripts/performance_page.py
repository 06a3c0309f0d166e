"""Measure the rasterizer and write docs/performance.md, figures and all.

Usage: python scripts/performance_page.py   (about three minutes; keep the machine quiet meanwhile)
"""

import platform
from pathlib import Path

from digs_warp.record.progress import show_progress
from digs_warp.record.run_log import versions
from digs_warp.study.bench_raster import SCENES, bench_raster
from digs_warp.study.bench_scaling import bench_scaling
from digs_warp.study.machine import processor
from digs_warp.study.plot_scaling import plot_scaling
from digs_warp.study.results import Result, format_number

TARGET = Path(__file__).resolve().parent.parent / "docs" / "performance.md"
PICTURE = TARGET.parent / "images" / "scaling.png"

TEXT = """# Performance

This page is written by `make performance`; the raw numbers come from `digs-warp bench raster --json FILE`
and `digs-warp bench scaling --json FILE`.
Measured on {machine},
Python {python}, Warp {warp}. Absolute times belong to the machine; the ratios are the point: both kernels
ran in one process, on the same splats, best of several launches after a warm-up.

*plain* is one Warp thread per pixel with `wp.exp` and an early exit, the way one writes it first (on a CPU
Warp runs it on one core). *vectorized* is what training uses: one thread per tile, inner loops that LLVM
turns into vector code, tiles shared out over the cores. Both give the same image, and a float64 twin in
the tests checks both.

How much threads can bring depends on the machine, too: here {worth}.

{tables}
*project* and *gather and project back* are one thread per splat in both variants. *bin* deals splats out
to tiles: one depth sort and a counting pass, against a sort of all (tile, splat) pairs.

How much of a core the two raster kernels use: row evaluations are (tile, splat, row) triples, and the rate
counts additions and multiplications against those of NumPy's float32 matrix product, the fastest that the
core does.

{rates}
## How time grows

One of pixels, splats, overlap and threads varies at a time; the lines are one law for all panels, fitted to
the points of one thread. *raster* is forward and backward of the two raster kernels, *per splat* projection,
binning and their gradient.

![Times of forward and backward over pixels, splats, overlap and threads](images/scaling.png)

{laws}
An evaluated pixel is one pixel under one splat, a pair one splat in one tile.

{memory}
The kernels of training compile in {cold} s, once for all runs, and load in {warm} s from then on.

What a whole run costs on your machine stands in its `report.html` and `run.json`: `make demo`, or
`digs-warp run --out out/mine`.

## Why it is fast

- A splat is evaluated in blocks of 2 rows by 8 columns, those that its ellipse touches: one vector of
  512 bits, or two of 256 that hide each other's latency. The exponential is a polynomial, branches are
  selects.
- All pixel state of a tile lies in one piece of memory on a boundary of 64 bytes: a vector across two cache
  lines that was just written cannot be read back before it has reached the cache.
- The records of the next sixteen splats are asked for at once, and which blocks each of them touches is found
  for eight at a time, before the first is drawn: the processor knows what comes next and waits for nothing.
- Blocks that a splat's ellipse does not touch and blocks whose pixels are all opaque are skipped; the
  backward pass takes over from the forward pass which are left.
- A read from a Warp array has a stride that is known only at run time and becomes a gather. Hot loops read
  through views made in the kernel, or copy to local state first, and have a fixed length.
- Telling LLVM that a row index is no negative one removes Warp's handling of such indices from the inner
  loops.
- The backward pass sums a splat's gradient by the place in the block first and reduces once per tile,
  not once per row.
- Each (tile, splat) pair owns one gradient record: no atomics, and the same bits for any number of threads.
  The records of a splat lie side by side.
- Loss and its gradient are computed only where splats or object are; tiles further away are not even filled
  with the background.

`tests/digs_warp/splat/test_vectorization.py` compiles the rasterizer with LLVM's remarks on and fails when
one of the hot loops is no longer vectorized.
"""


def main() -> None:
    """Measure and write the page."""
    show_progress()
    results = bench_raster()
    tables = "\n".join(scene_table(scene.name, results) for scene in SCENES)
    scaling = bench_scaling()
    PICTURE.write_bytes(plot_scaling(scaling))
    cold, warm = (r.value for r in scaling if r.name == "kernels")
    found = versions()
    machine = f"{processor()}, {platform.system()}"
    TARGET.write_text(
        TEXT.format(
            machine=machine,
            python=found["python"],
            warp=found["warp-lang"],
            worth=worth_sentence(results),
            tables=tables,
            rates=rate_table(results),
            laws=law_table(scaling),
            memory=memory_table(scaling),
            cold=f"{cold:.0f}",
            warm=f"{warm:.1f}",
        ),
        encoding="utf-8",
    )
    print(TARGET)  # noqa: T201 (a script)


def worth_sentence(results: list[Result]) -> str:
    """Say how many times the matrix products of one thread several threads get done."""
    worth = [r for r in results if r.name == "matrix products"]
    parts = [f"{r.settings['threads']} threads get {r.value:.2f} times as many done" for r in worth]
    return ", ".join(parts) + " as one that multiplies small matrices and waits for nothing"


def scene_table(scene: str, results: list[Result]) -> str:
    """Return the Markdown table of one scene: stages down, variants across."""
    times = [r for r in results if r.settings.get("scene") == scene and r.unit == "ms"]
    variants = list(dict.fromkeys((r.settings["kernel"], r.settings["threads"]) for r in times))
    cells = {(r.name, r.settings["kernel"], r.settings["threads"]): r.value for r in times}
    stages = list(dict.fromkeys(r.name for r in times))
    some = times[0].settings
    lines = [
        f"**{scene}**: {some['image']} px, {some['splats']:,} splats, {some['pairs']:,} (tile, splat) pairs",
        "",
        "| stage | "
        + " | ".join(f"{kernel}, {n} thread{'s'[: n > 1]}" for kernel, n in variants)
        + " |",
        "|---|" + "---|" * len(variants),
    ]
    for stage in stages:
        plain = cells[stage, *variants[0]]
        row = [f"{format_number(plain)} ms"]
        for variant in variants[1:]:
            value = cells[stage, *variant]
            row.append(f"{format_number(value)} ms ({plain / value:.1f}x)")
        lines.append(f"| {stage} | " + " | ".join(row) + " |")
    return "\n".join(lines) + "\n"


def rate_table(results: list[Result]) -> str:
    """Return the Markdown table of the raster kernels' rates on one thread."""
    lines = ["| scene | kernel | row evaluations | rate |", "|---|---|---|---|"]
    for scene in SCENES:
        found = {
            r.name: r
            for r in results
            if r.settings.get("scene") == scene.name and r.settings.get("threads") == 1
        }
        for stage in ("forward", "backward"):
            rows, rate = found[f"{stage} rows"], found[f"{stage} rate"]
            lines.append(
                f"| {scene.name} | {stage} | {rows.value:.0f} {rows.unit} | {rate.value:.0f} {rate.unit} |"
            )
    return "\n".join(lines) + "\n"


def law_table(results: list[Result]) -> str:
    """Return the Markdown table of the fitted laws."""
    lines = ["| time of | law | median error |", "|---|---|---|"]
    for law in ("raster", "per splat"):
        terms = [r for r in results if r.name == f"{law} law"]
        formula = " + ".join(f"{r.value:.3g} ns x {r.settings['per']}" for r in terms if r.value)
        error = next(r for r in results if r.name == f"{law} law error")
        lines.append(f"| {law} | {formula} | {error.value:.0f} % |")
    return "\n".join(lines) + "\n"


def memory_table(results: list[Result]) -> str:
    """Return the Markdown table of the bytes that training holds."""
    lines = ["| memory | bytes |", "|---|---|"]
    for r in results:
        if r.name == "memory":
            per = "splat" if "splat" in r.unit else "pixel"
            lines.append(f"| {r.settings['part']} | {r.value:.0f} per {per} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
