"""Held-out photographs in the exposure that their neighbors in time tell.

How bright a camera made a photograph that was held out, nothing in a reconstruction says. But a camera adapts
slowly: the exposures of the photographs before and after it, which the training has, are known. The held-out
photograph itself is not looked at.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.measure.color_gain import ColorGain
from digs_warp.measure.metrics import psnr
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.evaluate import (
    load_test_views,
    photographed_gain,
    render_views,
    with_gain,
)


def psnr_by_neighbors(
    gaussians: DeviceGaussians, training: Sequence[Frame], held_out: Sequence[Frame]
) -> float:
    """Return the PSNR on the object, in the exposure between those of the neighbors in time [dB].

    Args:
        gaussians: trained on ``training``.
        training: at least one frame; their renderings and photographs tell their exposures.
        held_out: which are rendered and compared; the result is the mean over them.
    """
    views = load_test_views(training)
    pairs = zip(render_views(gaussians, views), views, strict=True)
    gains = [photographed_gain([rendering], [view]) for rendering, view in pairs]
    times = np.array([frame.time for frame in training])
    tests = load_test_views(held_out)
    scores = [
        psnr(
            with_gain(rendering, interpolated(times, gains, frame.time)),
            view.target_for(rendering.image),
            view.object_pixels,
        )
        for frame, rendering, view in zip(
            held_out, render_views(gaussians, tests), tests, strict=True
        )
    ]
    return float(np.mean(scores))


def interpolated(times: np.ndarray, gains: Sequence[ColorGain], moment: float) -> ColorGain:
    """Return the gain at a moment, linear in time between the known ones; outside of them the nearest.

    Args:
        times: of n photographs [s], (n,), in any order.
        gains: theirs.
        moment: [s].
    """
    order = np.argsort(times, kind="stable")
    known = np.stack([gains[n].log_factors for n in order])
    factors = [np.interp(moment, times[order], values) for values in known.T]
    return ColorGain(np.array(factors))
