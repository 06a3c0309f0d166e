"""Measure files, films and meshes of Gaussians and write the figures into their pages, between the marks.

Usage: python scripts/splat_pages.py   (about five minutes; keep the machine quiet meanwhile)
"""

from page_marks import fill

from digs_warp.record.progress import show_progress
from digs_warp.record.run_log import versions
from digs_warp.study.bench_mesh import measure_meshes
from digs_warp.study.bench_render import measure_films
from digs_warp.study.bench_splat_files import measure_formats
from digs_warp.study.machine import processor
from digs_warp.study.results import Result, format_number
from digs_warp.study.trained_object import trained_object

FILES = """`digs-warp bench splat-files`, {splats:,} Gaussians of degree 3 (the built-in object), {where}.
PSNR is over the pixels that the object covers, against renders of what was written (100 dB: equal to the
last bit).

{table}
"""

FILMS = """`digs-warp bench render`, {splats:,} Gaussians of degree 3 that fill the height of the image,
{where}.

{table}
"""

MESHES = """`digs-warp bench mesh`: the built-in object, half a metre high, {splats:,} Gaussians, {views}
views, {where}.

{table}
"""


def main() -> None:
    """Measure and write the three pages."""
    show_progress()
    trained = trained_object()
    python = versions()["python"]
    about = {"splats": len(trained.gaussians), "where": f"{processor()}, Python {python}"}
    files = measure_formats(trained.gaussians)
    insert("interchange.md", FILES, files, ("format",), about)
    films = [r for r in measure_films(trained.gaussians) if r.unit == "1/s"]
    by_threads = [
        Result(f"frames/s, {r.settings['threads']} threads", r.value, "", r.settings) for r in films
    ]
    insert("render.md", FILMS, by_threads, ("image",), about)
    about["views"] = len(trained.cameras)
    insert("mesh.md", MESHES, measure_meshes(trained), ("voxel_mm",), about)


def insert(page: str, text: str, results: list[Result], keys: tuple[str, ...], about: dict) -> None:
    """Put ``text`` with a table of the results between the marks of a page."""
    fill(page, "figures", text.format(table=table(results, keys), **about))


def table(results: list[Result], keys: tuple[str, ...]) -> str:
    """Return a Markdown table: a row for every combination of the settings ``keys``."""
    rows: dict[tuple, dict[str, str]] = {}
    for result in results:
        row = rows.setdefault(tuple(result.settings[key] for key in keys), {})
        row[result.name] = f"{format_number(result.value)} {result.unit}".strip()
    columns = list(dict.fromkeys(result.name for result in results))
    titles = [key.replace("voxel_mm", "voxel [mm]") for key in keys]
    lines = [
        "| " + " | ".join([*titles, *columns]) + " |",
        "|---" * (len(keys) + len(columns)) + "|",
    ]
    lines += [
        "| " + " | ".join([*map(str, settings), *(row[name] for name in columns)]) + " |"
        for settings, row in rows.items()
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
