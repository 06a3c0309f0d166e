"""Figures, findings and pictures of docs/recordings.md.

Pictures are drawn of recordings whose license clearly allows it.
"""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from digs_warp.record.files import write_atomically
from digs_warp.study.scenes import sample_data
from scripts.page_marks import DOCS, fill
from studies.benchmarks import find_benchmark
from studies.pages import publish
from studies.real_recordings import RealRecording, find_recordings
from studies.recordings import Measured, measure_all, rows

PICTURES = "images/recordings"

# Two views beside each other, as wide as a page shows them [px], and what a picture may weigh [bytes].
WIDTH, LARGEST = 640, 60_000
QUALITIES = range(88, 20, -4)


def main() -> None:
    """Measure, draw, and fill the page."""
    data = sample_data()
    measured = list(measure_all(find_recordings(data), data))
    benchmark = find_benchmark("recordings")
    publish(benchmark, rows(measured))
    fill(benchmark.pages[0], "recordings", described([each.recording for each in measured]))
    fill(benchmark.pages[0], "pictures", "\n\n".join(filter(None, map(shown, measured))))


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
