"""Rendered against true held-out views: where the reconstruction is right and where it is not."""

from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, Frame
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.report.markup import (
    details,
    legend,
    number,
    picture,
    picture_grid,
    section,
    table,
)
from digs_warp.report.pictures import ColorScale, data_uri, over_white, shrink
from digs_warp.report.results import METRICS, Results

MAX_VIEWS = 6
PICTURE_WIDTH = 800  # pixels; three columns of about 400 on a common screen

# Full scale at 32 of 255 steps: an error that is just visible beside the truth is clearly visible here.
DIFFERENCE = ColorScale("mean absolute difference of the channels [of 255]", 0, 32, "magma")


def views_section(capture: Capture, results: Results) -> str:
    """Return the section.

    Raises:
        DigsError: the evaluation names a view that the capture or the renders lack.
    """
    ranked = sorted(results.views, key=lambda view: view.get("psnr") or 0.0)
    if not ranked:
        return section("Held-out views", "No view was held out.")
    chosen = np.linspace(0, len(ranked) - 1, min(MAX_VIEWS, len(ranked))).round().astype(int)
    rows = [(_label(ranked[i]), _cells(capture, results, str(ranked[i]["name"]))) for i in chosen]
    names = ("View", "PSNR [dB]", "SSIM", "PSNR in mask [dB]", "SSIM in mask")
    numbers = [[view["name"], *_metrics(view)] for view in results.views]
    mean = ["mean", *_metrics(results.mean)]
    return section(
        "Held-out views",
        f"{len(chosen)} of {len(ranked)} views that training never saw, from the worst to the best. "
        "The object stands on white, as it is trained and judged.",
        picture_grid(["True", "Rendered", "Difference, amplified"], rows),
        f"<div class=legends>{legend(DIFFERENCE)}</div>",
        details(f"Numbers of all {len(ranked)} views", table(names, [*numbers, mean])),
    )


def _label(view: dict[str, Any]) -> str:
    return (
        f"{view['name']}\n{number(view.get('psnr'), 2, 'dB')}\nSSIM {number(view.get('ssim'), 4)}"
    )


def _metrics(values: dict[str, Any]) -> list[str]:
    return [number(values.get(name), 2 if name.startswith("psnr") else 4) for name in METRICS]


def _cells(capture: Capture, results: Results, name: str) -> list[str]:
    frame = next((frame for frame in capture.frames if frame.name == name), None)
    if frame is None:
        raise DigsError(
            f"report: the evaluation in '{results.folder}' names view '{name}', which capture "
            f"'{capture.folder}' lacks; give the capture that was reconstructed"
        )
    truth = over_white(frame.load_image(), frame.load_mask() if frame.has(Layer.MASK) else None)
    rendered = _read_render(results, frame, truth.shape)
    difference = np.abs(truth.astype(np.float32) - rendered).mean(axis=2)
    images = {
        "true image": truth,
        "rendered image": rendered,
        "absolute difference in colours": DIFFERENCE.paint(difference),
    }
    cells = []
    for what, image in images.items():
        image = shrink(image, PICTURE_WIDTH)
        cells.append(
            picture(data_uri(image), f"View {name}: {what}", image.shape[1], image.shape[0])
        )
    return cells


def _read_render(results: Results, frame: Frame, shape: tuple[int, ...]) -> np.ndarray:
    path = results.folder / "renders" / f"{frame.name}.png"
    pixels = read_image(path, "rendered view")
    if pixels.dtype != np.uint8 or pixels.shape != shape:
        raise DigsError(
            f"rendered view '{path}': {pixels.shape} of {pixels.dtype}, expected {shape} of uint8 "
            "as the capture has; reconstruct again"
        )
    return pixels
