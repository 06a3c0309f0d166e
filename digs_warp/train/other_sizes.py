"""The held-out views from other distances: drawn at other sizes, and compared with the same photographs.

From half the distance an object is twice as large in the image. Photographs exist at one size only, so the
finer image is brought to theirs: the finer drawing is averaged over the area of each pixel, as a pixel of a
camera does it. Where the drawing is coarser, that is done to the photograph. A scene that looks right at the
size of its photographs alone loses here: splats that leave gaps when they are drawn larger, or grow together
when they are drawn smaller.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.data.viewpoints import evenly
from digs_warp.init.config import MASK_THRESHOLD
from digs_warp.measure.metrics import psnr
from digs_warp.measure.scores import OtherSizes, ViewScore, mean_score
from digs_warp.splat.config import DEFAULT_OPTIONS, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.evaluate import Rendering, TestView, color_aligned, drawn_views

# Field of `OtherSizes` -> width and height, in those of the photographs.
SIZES = {"half": 0.5, "four_thirds": 4.0 / 3.0, "double": 2.0}

# At twice the size a view takes four times as long, and a few tell enough.
MOST_VIEWS = 8


def measure_other_sizes(
    gaussians: DeviceGaussians, views: Sequence[TestView], scores: Sequence[ViewScore]
) -> OtherSizes | None:
    """Return the PSNR on the object at all sizes, the mean over at most `MOST_VIEWS` of the views.

    Args:
        gaussians: the result.
        views: held-out ones.
        scores: theirs, at the size of the photographs.

    Returns:
        None without views.
    """
    chosen = evenly(range(len(views)), MOST_VIEWS)
    if not chosen:
        return None
    seen = [views[number] for number in chosen]
    trained = mean_score([scores[number] for number in chosen]).psnr_object_aligned
    at = {name: psnr_at_size(gaussians, seen, size) for name, size in SIZES.items()}
    return OtherSizes(views=len(seen), trained=trained, **at)


def psnr_at_size(
    gaussians: DeviceGaussians,
    views: Sequence[TestView],
    size: float,
    options: RasterOptions = DEFAULT_OPTIONS,
) -> float:
    """Return the mean PSNR on the object [dB] of views drawn at another size, after the gain of each.

    Args:
        gaussians: the result.
        views: at the size of the photographs.
        size: width and height of the drawing, in those of the photograph, above 0.
        options: how splats are drawn.
    """
    drawn = [at_size(view, size) for view in views]
    compared = drawn if size < 1.0 else views
    renderings = drawn_views(gaussians, drawn, options)
    found = [
        _aligned_psnr(averaged(rendering, view), view)
        for rendering, view in zip(renderings, compared, strict=True)
    ]
    known = [value for value in found if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def _aligned_psnr(rendering: Rendering, view: TestView) -> float:
    target = view.target_for(rendering.image)
    return psnr(color_aligned(rendering, view), target, view.object_pixels)


def at_size(view: TestView, size: float) -> TestView:
    """Return a view at another size; its photograph keeps its own where the view becomes larger.

    Rows are counted in heights of the image, so the motion over them stays.
    """
    k = view.camera.intrinsics
    width, height = (max(1, round(size * length)) for length in (k.width, k.height))
    blur = view.blur and replace(view.blur, pixels=size * view.blur.pixels)
    resized = replace(view, camera=view.camera.resized(width, height), blur=blur)
    if size >= 1.0:
        return resized
    share = over_areas(view.share, width, height)
    unknown = view.unknown
    if unknown is not None:
        unknown = over_areas(unknown.astype(np.float32), width, height) > 0.0
    return replace(
        resized,
        target=over_areas(view.target, width, height),
        share=share,
        object_pixels=share > MASK_THRESHOLD / 255.0,
        unknown=unknown,
    )


def averaged(rendering: Rendering, view: TestView) -> Rendering:
    """Return a rendering at the size of a view's photograph, which is not larger."""
    height, width = view.target.shape[:2]
    light, coverage = (
        over_areas(each, width, height) for each in (rendering.light, rendering.coverage)
    )
    return Rendering(light, coverage)


def over_areas(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return an image, float32, whose pixels are the means over their areas; not larger in any direction."""
    import cv2

    if image.shape[:2] == (height, width):
        return image
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
