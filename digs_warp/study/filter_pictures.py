"""What each filter of the device does to matches of the built-in object: pictures and figures."""

import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.color import PIXEL_EFFECTS
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.error_attribution import WRONG
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.post_filters.chain import AfterMatching, Shot
from digs_warp.sim.sensor.post_filters.names import FILTERS
from digs_warp.sim.sensor.post_filters.temporal import EARLIER_FRAMES
from digs_warp.sim.sensor.scores import score
from digs_warp.sim.sensor.steps import find_steps
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.sensor_pictures import (
    LARGEST_RATIO,
    Panel,
    draw_panels,
    full_scale,
    window_of,
    with_holes,
)

# Steps of the true disparity that flying pixels are counted at [px].
STEP = 3.0

# Flying pixels lie between the two sides of a step that is at most this many pixels away, and not within
# this share of the step from either.
REACH, MARGIN = 3, 0.15

# Changes of disparity below this do not show in the pictures [px].
VISIBLE = 0.25

# Filters with a picture.
SHOWN = ("dense", "spatial", "temporal", "hole-filling")

# The threshold that the table shows beside the filters.
THRESHOLD = 0.8

ROUNDS = 3

# Of the walk; the one in the middle is shown.
FRAMES = 3


@dataclass(frozen=True, eq=False)
class FilterFigure:
    """A frame after something that the device does.

    Attributes:
        fill: share of the pixels with true depth that have a value.
        bad_1: share of the values with errors above one pixel.
        rms: RMS error of the other values [px].
        flying: pixels in mid-air per pixel of outline.
        filled_right: share of the filled holes that are right within a pixel; NaN: none were filled.
        filled_confidence: mean confidence of the filled holes.
        time: [ms/MP].
    """

    fill: float
    bad_1: float
    rms: float
    flying: float
    filled_right: float
    filled_confidence: float
    time: float


def filter_figures(folder: Path) -> dict[str, FilterFigure]:
    """Draw the strips of SHOWN into ``folder``, and return the figures by the name of what acts.

    The frame is one of a recording without ground, at half a turn; the camera is at rest.
    """
    config = SimulateConfig(frames=FRAMES, ground="none")
    session = prepare_session(config, load_inputs(config))
    truth, _ = session.truth(FRAMES // 2, Shutter())
    shots = [_shot(replace(truth, number=number)) for number in range(1 + EARLIER_FRAMES)]
    devices = {
        "none": AfterMatching(),
        f"threshold {THRESHOLD:g}": AfterMatching(threshold=THRESHOLD),
        **{name: AfterMatching((name,)) for name in FILTERS},
    }
    figures = {}
    for name, device in devices.items():
        apply = partial(device.apply, shots[-1 - device.earlier_frames :])
        figures[name] = _figure(apply(), shots[-1].sensed, truth, _seconds(apply))
        if name in SHOWN:
            filter_strip(truth, shots[-1].sensed, apply(), folder / f"{name}.jpg")
    return figures


def _shot(truth: FrameTruth) -> Shot:
    """Return what the default sensor matches on a frame, with the noise of its number."""
    recorded = recorded_images(truth, PIXEL_EFFECTS)
    return Shot(sense(truth, "guided", recorded=recorded), gray_of(recorded[0]))


def _figure(after: Sensed, before: Sensed, truth: FrameTruth, seconds: float) -> FilterFigure:
    scores = score(after.disparity, truth)
    filled = after.known & ~before.known & ~np.isnan(truth.disparity)
    right = np.abs(after.disparity - truth.disparity) <= WRONG
    return FilterFigure(
        fill=scores.fill,
        bad_1=scores.bad_1,
        rms=scores.rms,
        flying=flying_pixels(after.disparity, truth.disparity),
        filled_right=float(right[filled].mean()) if filled.any() else np.nan,
        filled_confidence=float(after.confidence[filled].mean()) if filled.any() else np.nan,
        time=1e3 * seconds / (truth.disparity.size / 1e6),
    )


def flying_pixels(disparity: np.ndarray, true: np.ndarray) -> float:
    """Return the pixels in mid-air between the two sides of a step, per pixel of outline.

    Args:
        disparity: [px], (height, width), NaN where there is none.
        true: of the same shape.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    size = 2 * REACH + 1
    near = maximum_filter(np.nan_to_num(true), size)
    far = minimum_filter(np.nan_to_num(true), size)
    gap = near - far
    between = (disparity > far + MARGIN * gap) & (disparity < near - MARGIN * gap)
    in_air = (gap > STEP) & between & (np.abs(disparity - true) > WRONG)
    outline = sum(len(steps.rows) for steps in find_steps(true, STEP))
    return float(np.count_nonzero(in_air)) / max(outline, 1)


def _seconds(function: partial[Sensed]) -> float:
    """Return the CPU time of the fastest of some calls."""
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def filter_strip(truth: FrameTruth, before: Sensed, after: Sensed, path: Path) -> None:
    """Draw left image, disparity off and on, and the error, as one JPEG."""
    from matplotlib.colors import LogNorm

    with np.errstate(invalid="ignore"):
        moved = np.abs(after.disparity - before.disparity) > VISIBLE
    rows, columns = window_of(moved | (after.known & ~before.known))
    error = after.disparity - truth.disparity
    scale = full_scale(np.abs(error[rows, columns]))
    low, high = np.nanpercentile(truth.disparity[rows, columns], [1, 99])
    low = max(low, high / LARGEST_RATIO)
    near_far = {"cmap": with_holes("turbo"), "norm": LogNorm(low, max(high, 1.5 * low), clip=True)}
    signed = {"cmap": with_holes("RdBu"), "vmin": -scale, "vmax": scale}
    panels: list[Panel] = [
        ("left image", truth.image, {}),
        ("disparity, off", before.disparity, near_far),
        ("disparity, on", after.disparity, near_far),
        (f"error, ±{scale:g} px", error, signed),
    ]
    draw_panels([(title, pixels[rows, columns], style) for title, pixels, style in panels], path)
