"""Measure the training and write docs/training.md and its picture, figures and all.

Usage: python scripts/training_page.py   (about five minutes; keep the machine quiet meanwhile)
"""

import platform
from pathlib import Path

from digs_warp.record.files import write_atomically
from digs_warp.record.progress import show_progress
from digs_warp.record.run_log import versions
from digs_warp.study.bench_convergence import bench_convergence
from digs_warp.study.bench_options import bench_options
from digs_warp.study.bench_train import bench_train
from digs_warp.study.machine import processor
from digs_warp.study.plot_convergence import plot_convergence
from digs_warp.study.results import Result, format_number
from digs_warp.train.config import TrainConfig
from digs_warp.train.density.budget import bytes_per_splat

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = DOCS / "training.md"
PICTURE = DOCS / "images" / "convergence.png"

TEMPLATE = Path(__file__).resolve().with_suffix(".md")


def main() -> None:
    """Measure and write the page."""
    show_progress()
    convergence, options, train = bench_convergence(), bench_options(), bench_train()
    write_atomically(PICTURE, plot_convergence(convergence))
    found = versions()
    some = options[0].settings
    text = TEMPLATE.read_text(encoding="utf-8").format(
        machine=f"{processor()}, {platform.system()}",
        python=found["python"],
        warp=found["warp-lang"],
        threads=some["threads"],
        dense=in_words("fixed"),
        reference=in_words("default"),
        convergence=convergence_table(convergence),
        bytes_0=bytes_per_splat(0),
        bytes_1=bytes_per_splat(1),
        bytes_3=bytes_per_splat(3),
        image=some["image"],
        start=f"{some['start']:,}",
        iterations=some["iterations"],
        options=options_table(options),
        stages=stages_table(train),
    )
    write_atomically(PAGE, text.encode())
    print(PAGE)  # noqa: T201 (a script)


def in_words(density: str) -> str:
    """Return the rates that go with a density control."""
    rates = TrainConfig(density=density).rates  # pyright: ignore[reportArgumentType]
    groups = ("means", "scales", "quats", "opacities", "colors")
    return ", ".join(f"{name} {getattr(rates, name):g}" for name in groups)


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def convergence_table(results: list[Result]) -> str:
    """Iterations down, settings across: PSNR and seconds."""
    names = list(dict.fromkeys(r.settings["settings"] for r in results))
    steps = list(dict.fromkeys(r.settings["iteration"] for r in results))
    cells = {
        (r.settings["iteration"], r.settings["settings"]): (
            f"{r.value:.2f} dB after {r.settings['seconds']:.1f} s"
        )
        for r in results
    }
    first = results[0].settings
    title = (
        f"Held-out PSNR, built-in object, {first['image']} px, {first['splats']:,} Gaussians:\n\n"
    )
    rows = [[str(step), *(cells[step, name] for name in names)] for step in steps]
    return title + table(["iteration", *names], rows)


def options_table(results: list[Result]) -> str:
    """Options down, measures across."""
    measures = list(dict.fromkeys(r.name for r in results))
    rows: dict[str, list[str]] = {}
    for r in results:
        value = f"{r.value:,.0f}" if r.unit == "" else format_number(r.value)
        rows.setdefault(r.settings["option"], []).append(value)
    return table(["option", *measures], [[f"`{name}`", *row] for name, row in rows.items()])


def stages_table(results: list[Result]) -> str:
    """Stages down, image sizes across."""
    sizes = list(dict.fromkeys((r.settings["image"], r.settings["splats"]) for r in results))
    names = list(dict.fromkeys(r.name for r in results))
    cells = {(r.name, r.settings["image"]): f"{format_number(r.value)} {r.unit}" for r in results}
    rows = [[name, *(cells[name, image] for image, _ in sizes)] for name in names]
    return table(["stage", *(f"{image}, {splats:,} splats" for image, splats in sizes)], rows)


if __name__ == "__main__":
    main()
