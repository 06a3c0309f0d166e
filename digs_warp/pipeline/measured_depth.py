"""The measured depth of a recording for its mesh, and how far it is trusted.

The photographs tell that, as they do in the training (`digs_warp.train.depth_errors`): where whole regions of
the measured depth lie off the surface of the Gaussians, that surface is the better one. Where only single
pixels do, measured depth is as good as it, and its errors are others: together they are better than each.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.surface.depth_views import depth_views
from digs_warp.surface.extract import OBJECT_THRESHOLD, Layers
from digs_warp.train.depth_errors import (
    TRUSTED_IN_SCENES,
    TRUSTED_SPREAD,
    DepthErrors,
    DepthJudge,
    DepthSamples,
)

# The trust hardly changes with more views.
VIEWS = 8
# Depth that is trusted less is left out: its errors are larger than those of the Gaussians.
LEAST_TRUST = 0.5


@dataclass(frozen=True, eq=False)
class MeasuredDepth:
    """What is fused beside the rendered depth.

    Attributes:
        load: reads the depth of each frame without its offset [m], NaN where unknown.
        trust: in it, `LEAST_TRUST` to 1.
    """

    load: Layers
    trust: float


def measured_depth(
    gaussians: Gaussians, frames: Sequence[Frame], center_world: np.ndarray, is_object: bool
) -> MeasuredDepth | None:
    """Return the measured depth of frames; None where one has none, or it is not trusted.

    Args:
        gaussians: what was reconstructed from the frames.
        frames: as posed.
        center_world: where the scene is [m].
        is_object: whether the Gaussians are of one object, trained with masks.
    """
    if not frames or not all(frame.has(Layer.DEPTH) for frame in frames):
        return None
    errors = _errors(gaussians, evenly(frames, VIEWS), center_world, is_object)
    if errors.trust < LEAST_TRUST:
        return None
    return MeasuredDepth([partial(_loaded, f, errors.offset) for f in frames], errors.trust)


def _errors(
    gaussians: Gaussians, frames: Sequence[Frame], center_world: np.ndarray, is_object: bool
) -> DepthErrors:
    judge = DepthJudge(len(frames), TRUSTED_SPREAD if is_object else TRUSTED_IN_SCENES)
    cameras = [frame.camera for frame in frames]
    views = depth_views(gaussians, cameras, center_world, is_object=is_object)
    for number, (view, frame) in enumerate(zip(views, frames, strict=True)):
        measured = frame.load_depth()
        known = np.isfinite(measured) & np.isfinite(view.depth)
        if frame.has(Layer.MASK):
            known &= frame.load_mask() > OBJECT_THRESHOLD
        samples = DepthSamples.of(measured, known)
        rendered = view.depth[samples.rows, samples.columns].astype(np.float64)
        judge.fit(number, rendered, samples.depths, samples.cells)
    return judge.errors


def _loaded(frame: Frame, offset: float) -> np.ndarray:
    measured = frame.load_depth()
    return measured / np.maximum(1.0 - offset * measured, 0.1)
