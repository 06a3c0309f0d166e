"""Reconstruct real recordings and write figures, findings and pictures into docs/real-recordings.md.

Usage: python scripts/recordings_page.py [NAME ...]   (needs the sample data; default: all of it)

Pictures are drawn of recordings whose license clearly allows it.
"""

import sys
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from page_marks import DOCS, fill
from pages import publish
from PIL import Image

from digs_warp.record.files import write_atomically
from digs_warp.record.progress import show_progress
from digs_warp.study.bench_recordings import Measured, measure_all, rows
from digs_warp.study.benchmarks import find_benchmark
from digs_warp.study.real_recordings import RealRecording, find_recordings
from digs_warp.study.scenes import sample_data

PICTURES = "images/recordings"

# Two views beside each other, as wide as a page shows them [px], and what a picture may weigh [bytes].
WIDTH, LARGEST = 640, 60_000
QUALITIES = range(88, 20, -4)


def main(names: Sequence[str]) -> None:
    """Measure, draw, and fill the page."""
    show_progress()
    data = sample_data()
    measured = list(measure_all(find_recordings(data, names), data))
    benchmark = find_benchmark("recordings")
    publish(benchmark, rows(measured))
    fill(benchmark.page, "recordings", described([each.recording for each in measured]))
    fill(benchmark.page, "pictures", "\n\n".join(filter(None, map(shown, measured))))


def described(recordings: Sequence[RealRecording]) -> str:
    """Return the list of the recordings, with who made them."""
    return "\n".join(f"- `{each.name}`: {each.what}. {each.credit}." for each in recordings)


def shown(measured: Measured) -> str:
    """Write the picture and return what shows it; empty where there is none, or none is allowed."""
    recording = measured.recording
    if measured.picture is None or not recording.pictures_allowed:
        return ""
    path = Path(PICTURES) / f"{recording.name}.jpg"
    write_atomically(DOCS / path, small_jpeg(measured.picture))
    return f"![{recording.name}, photographs and rendered views]({path})\n\n*Images: {recording.credit}.*"


def small_jpeg(pixels: np.ndarray) -> bytes:
    """Return a JPEG of `WIDTH` that weighs at most `LARGEST`."""
    picture = Image.fromarray(pixels)
    picture = picture.resize((WIDTH, round(WIDTH * picture.height / picture.width)))
    for quality in QUALITIES:
        data = BytesIO()
        picture.save(data, "JPEG", quality=quality, optimize=True)
        if data.tell() <= LARGEST:
            break
    return data.getvalue()


if __name__ == "__main__":
    main(sys.argv[1:])
