"""What writes figures and pictures into the documentation, between the marks of its pages."""

import importlib
import platform
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from digs_warp.record.files import write_atomically
from digs_warp.record.run_log import versions
from digs_warp.study.scenes import processor
from scripts.page_marks import fill, marks
from studies.benchmarks import Benchmark
from studies.results import Result, tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# What is no table of a benchmark: the name of a page, and the module here that writes it.
PAGES = {
    "demo": "demo",
    "gallery": "gallery",
    "sensor": "sensor",
    "randomization": "randomization",
    "what-is-read": "what_is_read",
    "real-recordings": "real_recordings",
    "studies": "published",
}


def write(name: str) -> None:
    """Write one of `PAGES`."""
    importlib.import_module(f"studies.pages.{PAGES[name]}").main()


def publish(benchmark: Benchmark, results: Sequence[Result]) -> None:
    """Write what a benchmark measured into its pages; a page shows the tables that it has marks for.

    The mark of a table is the name of the benchmark, followed by that of the table where it has one.
    """
    texts = {f"{benchmark.name} {t.name}".strip(): t.markdown() for t in tables(results)}
    texts["machine"] = measured_on()
    for page in benchmark.pages:
        for mark in marks(page):
            if mark in texts:
                fill(page, mark, texts[mark])


def save_figure(figure: "Figure", path: Path, quality: int) -> None:
    """Write a figure as JPEG; the same pixels give the same bytes."""
    data = BytesIO()
    figure.savefig(data, format="jpeg", pil_kwargs={"quality": quality, "optimize": True})
    write_atomically(path, data.getvalue())


def measured_on() -> str:
    """Return what figures were measured on, as a sentence."""
    found = versions()
    return (
        f"Measured on {processor()}, {platform.system()}, Python {found['python']}, "
        f"Warp {found['warp-lang']}."
    )
