"""Rendered and true held-out views side by side, to show where the reconstruction is wrong."""

from dataclasses import dataclass
from html import escape

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.init.start import Subject
from digs_warp.measure.scores import METRICS, Score, ViewScore
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.markup import (
    details,
    legend,
    number,
    picture,
    picture_grid,
    section,
    table,
)
from digs_warp.show.report.pictures import ColorScale, data_uri, over_white, shrink
from digs_warp.train.silhouette import without_surround

MAX_VIEWS, IN_SIGHT = 6, 3
PICTURE_WIDTH = 800  # pixels; three columns of about 400 on a common screen

# Full scale at 32 of 255 steps: an error that is just visible beside the truth is clearly visible here.
DIFFERENCE = ColorScale("mean absolute difference of the channels [of 255]", 0, 32, "magma")


_HEADINGS = {
    "psnr_object": "PSNR, object [dB]",
    "ssim_object": "SSIM, object",
    "psnr_object_aligned": "PSNR, object, color-aligned [dB]",
    "psnr_frame": "PSNR, frame [dB]",
    "ssim_frame": "SSIM, frame",
    "psnr_frame_aligned": "PSNR, frame, color-aligned [dB]",
}


@dataclass(frozen=True)
class _Compared:
    """What the figures of a view are of: the names of its metrics, and what the pictures show."""

    psnr: str
    ssim: str
    metrics: tuple[str, ...]
    shown: str


_OF: dict[Subject, _Compared] = {
    "object": _Compared(
        "psnr_object",
        "ssim_object",
        METRICS,
        "The object is shown on white, as in training and evaluation.",
    ),
    "scene": _Compared(
        "psnr_frame",
        "ssim_frame",
        tuple(name for name in METRICS if "frame" in name),
        "No object was cut out: the figures are of everything in view.",
    ),
}


def views_section(capture: Capture, result: Reconstruction) -> str:
    """Return the section.

    Raises:
        DigsError: the evaluation names a view that the capture or the renders lack.
    """
    views = result.scores.views
    of = _OF[result.poses.subject]
    ranked = sorted(views, key=lambda view: np.nan_to_num(getattr(view, of.psnr)))
    if not ranked:
        return section("Held-out views", "No view was held out.", name="views")
    chosen = np.linspace(0, len(ranked) - 1, min(MAX_VIEWS, len(ranked))).round().astype(int)
    rows = [(_label(ranked[i], of), _cells(capture, result, ranked[i].name)) for i in chosen]
    in_sight = rows if len(rows) <= IN_SIGHT else [rows[0], rows[len(rows) // 2], rows[-1]]
    others = [row for row in rows if row not in in_sight]
    headings = ["True", "Rendered", "Difference, amplified"]
    names = ["View", *(_HEADINGS[name] for name in of.metrics)]
    numbers = [[view.name, *_metrics(view, of)] for view in views]
    mean = ["mean", *_metrics(result.scores.mean, of)]
    return section(
        "Held-out views",
        f"{_which(len(chosen), len(ranked))} {of.shown}",
        picture_grid(headings, in_sight),
        f"<div class=legends>{legend(DIFFERENCE)}</div>",
        details(f"{len(others)} more", picture_grid(headings, others)) if others else "",
        details(
            "Numbers of this view"
            if len(ranked) == 1
            else f"Numbers of {_all(len(ranked)).lower()} views",
            f"{table(names, [*numbers, mean])}<p>{escape(_aligned_words(result))}</p>",
        ),
        name="views",
    )


def _which(shown: int, total: int) -> str:
    """Say how many of the held-out views are shown."""
    if total == 1:
        return "The view that training never saw."
    count = _all(total) if shown == total else f"{shown} of {total}"
    return f"{count} views that training never saw, from the worst to the best."


def _all(count: int) -> str:
    return "Both" if count == 2 else f"All {count}"


def _aligned_words(result: Reconstruction) -> str:
    words = "Color-aligned: after exposure and white balance of the photograph were fitted."
    if result.training.exposure_stops is None:
        return words
    if not result.training.exposure_stops:
        return f"{words} The training views have the same."
    return (
        f"{words} Those of the training views differ by {result.training.exposure_stops:.2f} stops."
    )


def _label(view: ViewScore, of: _Compared) -> str:
    psnr, ssim = getattr(view, of.psnr), getattr(view, of.ssim)
    return f"{view.name}\n{number(psnr, 2, 'dB')}\nSSIM {number(ssim, 4)}"


def _metrics(score: Score, of: _Compared) -> list[str]:
    return [number(getattr(score, name), 2 if "psnr" in name else 4) for name in of.metrics]


def _cells(capture: Capture, result: Reconstruction, name: str) -> list[str]:
    frame = next((frame for frame in capture.frames if frame.name == name), None)
    if frame is None:
        raise DigsError(
            f"report: the evaluation in '{result.folder}' names view '{name}', which capture "
            f"'{capture.folder}' lacks; give the capture that was reconstructed"
        )
    truth = frame.load_image()
    if frame.has(Layer.MASK) and result.poses.subject == "object":
        mask = frame.load_mask()
        truth = over_white(without_surround(truth, mask), mask)
    rendered = result.load_render(frame.name, truth.shape)
    difference = np.abs(truth.astype(np.float32) - rendered).mean(axis=2)
    images = {
        "true image": truth,
        "rendered image": rendered,
        "absolute difference in colors": DIFFERENCE.paint(difference),
    }
    cells = []
    for what, image in images.items():
        image = shrink(image, PICTURE_WIDTH)
        cells.append(
            picture(data_uri(image), f"View {name}: {what}", image.shape[1], image.shape[0])
        )
    return cells
