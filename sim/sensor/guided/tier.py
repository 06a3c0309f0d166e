"""The 'guided' tier on a frame of the simulator."""

from collections.abc import Collection

import numpy as np

from digs_warp.sim.sensor.blame import blame
from digs_warp.sim.sensor.effects import SECOND_SURFACE_NAMES
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.guided.blocks import BLOCK, BLOCKS, MAX_BLOCKS
from digs_warp.sim.sensor.guided.confidence import confidence_of
from digs_warp.sim.sensor.guided.search import search
from digs_warp.sim.sensor.guided.second_surface import second_disparity
from digs_warp.sim.sensor.matcher import search_range


def sense_by_guided_matching(
    truth: FrameTruth,
    recorded: tuple[np.ndarray, np.ndarray] | None = None,
    effects: Collection[str] = SECOND_SURFACE_NAMES,
) -> Sensed:
    """Match the two images of a frame near the truth, which the confidence does not know.

    Args:
        truth: of the frame; it also tells the cause of what is missing or wrong.
        recorded: left and right image after the effects on images, sRGB, each (height, width, 3),
            uint8; None: the images of the truth.
        effects: names of those whose second surfaces the search tries: what shows through glass, what
            mirrors reflect. Only where such materials are in view, this costs time.
    """
    rig = truth.rig
    left, right = map(gray_of, recorded or (truth.image, truth.right))
    disparities = min(max(search_range(rig), BLOCKS * BLOCK), MAX_BLOCKS * BLOCK)
    second = second_disparity(truth, effects)
    # Where the calibration has drifted, the match is not at the true disparity.
    found = search(left, right, truth.shown_disparity, disparities, rig.window, second)
    confidence = confidence_of(left, found.disparity, found.cost, found.rival, rig.window)
    disparity = truth.drift.reported_disparity(found.disparity)
    return Sensed(disparity, blame(disparity, truth), confidence, owned=True)
