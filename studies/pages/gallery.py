"""Runs the examples of the gallery in docs/results.md, photographs their reports, and films one.

Runs that are there are kept. Needs Chromium (apt-get install chromium), and the sample data for its meshes.
"""

import shlex
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.data.images import encode_jpeg
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.files import write_atomically
from digs_warp.study.scenes import sample_data
from scripts.headless_browser import browser
from scripts.page_marks import DOCS, fill
from studies.pages.demo import shown

PAGE, PICTURES = "results.md", "images/gallery"
FOLDER = Path("out/gallery")
FILMED, FILM = "helmet", "--width 300 --height 360 --seconds 4 --fps 12"  # of README
WINDOW, SHOWN = (1280, 800), 645  # [px] height of verdict and view in it


@dataclass(frozen=True)
class Example:
    """A run of the gallery.

    Attributes:
        name: of its folder and its picture.
        title: what is seen.
        flags: of ``digs-warp run``; DATA stands for the folder of the sample data.
        credit: of what others made; empty: nothing.
    """

    name: str
    title: str
    flags: str
    credit: str = ""


EXAMPLES = (
    Example("builtin", "The built-in object in the built-in room", ""),
    Example(
        "mustard",
        "A bottle of mustard, from a mesh",
        "--mesh DATA/meshes/ycb_mustard_bottle/ycb_mustard_bottle.glb",
        "Mesh: YCB Object and Model Set (Calli, Singh, Walsman, Srinivasa, Abbeel, Dollar), "
        "[CC BY 4.0](https://creativecommons.org/licenses/by/4.0/)",
    ),
    Example(
        "tea-set",
        "A tea set on a table, from a mesh",
        "--mesh DATA/meshes/tea_set/tea_set.glb",
        'Mesh: "tea_set_01", Poly Haven, posed by Toyota Research Institute, '
        "[CC0 1.0](https://creativecommons.org/publicdomain/zero/1.0/)",
    ),
    Example(
        "helmet",
        "A leather flight helmet: glass, metal, fur",
        "--mesh DATA/meshes/flight_helmet/flight_helmet.glb --object-size 0.45",
        'Mesh: "FlightHelmet", Khronos glTF samples, Microsoft, '
        "[CC0 1.0](https://creativecommons.org/publicdomain/zero/1.0/)",
    ),
    Example(
        "armchair",
        "An armchair under a forest sky, by a RealSense D455",
        "--mesh DATA/meshes/armchair/armchair.glb --mesh-unit cm --profile d455 --width 640 "
        "--environment DATA/envs/forest_slope/forest_slope_1k.hdr",
        "Mesh: NVIDIA Kaolin samples, [CC BY 4.0](https://creativecommons.org/licenses/by/4.0/); panorama: "
        '"forest_slope", Poly Haven, CC0 1.0',
    ),
    Example(
        "room",
        "A room: everything in view, not only the object",
        "--subject scene --width 320 --frames 16 --iterations 300",
    ),
)


def main(folder: Path = FOLDER) -> None:
    """Make what is missing, and write the gallery."""
    sections = [section(example, folder / example.name) for example in EXAMPLES]
    fill(PAGE, "examples", "\n\n".join(sections))
    film = ["render", str(folder / FILMED), "--out", str(DOCS / "images/orbit.gif"), *FILM.split()]
    subprocess.run([sys.executable, "-m", "digs_warp", *film, "--overwrite"], check=True)


def section(example: Example, run: Path) -> str:
    """Run an example if it is not there yet, photograph its report and return its text."""
    report = run / "report.html"
    if not report.exists():
        words = [word.replace("DATA", str(sample_data())) for word in command(example, run)[1:]]
        subprocess.run([sys.executable, "-m", "digs_warp", *words, "--resume"], check=True)
    picture = Path(PICTURES) / f"{example.name}.jpg"
    write_atomically(DOCS / picture, encode_jpeg(photograph(report), 80))
    lines = (
        f"### {example.title}",
        f"`{shlex.join(command(example, FOLDER / example.name))}`",
        figures(run),
        f"![The report of the run: {example.title.lower()}]({picture})",
        f"*{example.credit}.*" if example.credit else "",
    )
    return "\n\n".join(line for line in lines if line)


def command(example: Example, run: Path) -> list[str]:
    """Return the words that make an example."""
    return ["digs-warp", "run", *shlex.split(example.flags), "--out", str(run)]


def photograph(report: Path) -> np.ndarray:
    """Return the window of a browser with the top of a report."""
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        browser(Path(folder), WINDOW) as tab,
    ):
        tab.resize(*WINDOW)
        tab.visit(report.resolve().as_uri())
        return np.ascontiguousarray(shown(tab)[:SHOWN])


def figures(run: Path) -> str:
    """Return the result of a run in a sentence."""
    result = Reconstruction.load(run)
    return f"{len(result.gaussians):,} Gaussians, {result.quality}."
