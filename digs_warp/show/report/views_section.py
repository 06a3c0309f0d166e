"""Rendered and true held-out views side by side, to show where the reconstruction is wrong."""

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import spread
from digs_warp.measure.scores import Score
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

# Around the object, pictures show this share of its size.
MARGIN = 0.15

# Full scale at 32 of 255 steps: an error that is just visible beside the truth is clearly visible here.
DIFFERENCE = ColorScale("mean absolute difference of the channels [of 255]", 0, 32, "magma")


def views_section(capture: Capture, result: Reconstruction) -> str:
    """Return the section.

    Raises:
        DigsError: the evaluation names a view that the capture or the renders lack.
    """
    what = "object" if result.poses.subject == "object" else "frame"

    def words(score: Score) -> tuple[str, str]:
        """Return what the figures of a view are: of the object, or of everything in view."""
        psnr, ssim = (getattr(score, f"{name}_{what}") for name in ("psnr", "ssim"))
        return number(psnr, 2, "dB"), number(ssim, 4)

    views = result.scores.views
    ranked = sorted(views, key=lambda view: np.nan_to_num(getattr(view, f"psnr_{what}")))
    if not ranked:
        return section("Held-out views", "No view was held out.", name="views")
    chosen = spread(len(ranked), MAX_VIEWS)
    rows = [
        ("{}\n{}\nSSIM {}".format(view.name, *words(view)), _cells(capture, result, view.name))
        for view in (ranked[i] for i in chosen)
    ]
    in_sight = rows if len(rows) <= IN_SIGHT else [rows[0], rows[len(rows) // 2], rows[-1]]
    others = [row for row in rows if row not in in_sight]
    headings = ["True", "Rendered", "Difference, amplified"]
    shown = "The object is shown on white, as in training and evaluation."
    if what == "frame":
        shown = "No object was cut out: the figures are of everything in view."
    count = str(len(chosen)) if len(chosen) == len(views) else f"{len(chosen)} of {len(views)}"
    return section(
        "Held-out views",
        f"{count} views that training never saw, from the worst to the best. {shown}",
        picture_grid(headings, in_sight),
        f"<div class=legends>{legend(DIFFERENCE)}</div>",
        details(f"{len(others)} more", picture_grid(headings, others)) if others else "",
        details(
            f"Numbers of all {len(views)} views",
            table(["View", "PSNR", "SSIM"], [[view.name, *words(view)] for view in views]),
        ),
        name="views",
    )


def _cells(capture: Capture, result: Reconstruction, name: str) -> list[str]:
    frame = next((frame for frame in capture.frames if frame.name == name), None)
    if frame is None:
        raise DigsError(
            f"report: the evaluation in '{result.folder}' names view '{name}', which capture "
            f"'{capture.folder}' lacks; give the capture that was reconstructed"
        )
    truth, around = frame.load_image(), (slice(None), slice(None))
    if frame.has(Layer.MASK) and result.poses.subject == "object":
        mask = frame.load_mask()
        truth, around = over_white(without_surround(truth, mask), mask), _around(mask)
    rendered = result.load_render(frame.name, truth.shape)
    difference = np.abs(truth.astype(np.float32) - rendered).mean(axis=2)
    images = {
        "true image": truth,
        "rendered image": rendered,
        "absolute difference in colors": DIFFERENCE.paint(difference),
    }
    small = {what: shrink(image[around], PICTURE_WIDTH) for what, image in images.items()}
    return [
        picture(data_uri(image), f"View {name}: {what}", image.shape[1], image.shape[0])
        for what, image in small.items()
    ]


def _around(mask: np.ndarray) -> tuple[slice, slice]:
    """Return the rows and columns of a square around the object, as far as the image reaches."""
    places = np.argwhere(mask)
    if not len(places):
        return slice(None), slice(None)
    low, high = places.min(axis=0), places.max(axis=0) + 1
    side = int(np.ceil((1 + 2 * MARGIN) * (high - low).max()))
    size = np.minimum(side, mask.shape)
    start = np.clip((low + high - size) // 2, 0, mask.shape - size)
    return slice(start[0], start[0] + size[0]), slice(start[1], start[1] + size[1])
