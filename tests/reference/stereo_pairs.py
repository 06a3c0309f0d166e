"""Pairs of images with closed-form disparity, made by exact warping of a smooth random texture."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import map_coordinates

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.error_attribution import WRONG
from digs_warp.sim.sensor.facts import STEP
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.steps import near_steps
from reference.stereo_frames import CountedRays, broadband, make_frame, make_rig
from studies.stereo_scores import share_of


class HiddenRays(CountedRays):
    """Rays of a scene whose hidden pixels are known."""

    def __init__(self, hidden: np.ndarray) -> None:
        super().__init__(hidden.shape)
        self.hidden = hidden

    def right_visibility(
        self, where: np.ndarray | None = None, depth: np.ndarray | None = None
    ) -> np.ndarray:
        visible = super().right_visibility(where) & ~self.hidden
        return visible if where is None else visible | ~where


def shifted_right_eye(left: np.ndarray, disparity: float) -> np.ndarray:
    """What the right eye sees of a plane that the left one sees as ``left``: u_right = u_left - d."""
    rows, columns = np.indices(left.shape[:2]).astype(np.float64)
    gray = left[..., 0].astype(np.float64)
    moved = map_coordinates(gray, [rows, columns + disparity], order=5, mode="mirror")
    return np.repeat(np.clip(np.rint(moved), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def plane_pair(disparity: float, rig: StereoRig | None = None, seed: int = 0) -> FrameTruth:
    """A plane parallel to the image that fills it."""
    rig = rig or make_rig()
    shape = (rig.intrinsics.height, rig.intrinsics.width)
    left = broadband(shape, seed)
    truth = make_frame(disparity, rig, left)
    return replace(truth, right=shifted_right_eye(left, disparity))


def box_frame(
    near: float,
    far: float,
    near_texture: float = 1.0,
    far_texture: float = 1.0,
    rig: StereoRig | None = None,
    number: int = 0,
) -> tuple[FrameTruth, tuple[slice, slice]]:
    """A near rectangle in the middle of a far plane that knows what it hides to its left, and its pixels.

    Textures are factors on a contrast of 30 DN round mid-gray, so the outline itself adds little.
    """
    rig = rig or make_rig()
    k = rig.intrinsics
    box = (slice(k.height // 4, 3 * k.height // 4), slice(2 * k.width // 5, 3 * k.width // 5))
    disparity = np.full((k.height, k.width), far)
    disparity[box] = near
    base = broadband((k.height, k.width), 3, 30.0).astype(np.float64) - 128
    contrast = np.full((k.height, k.width, 1), far_texture)
    contrast[box] = near_texture
    image = np.clip(np.rint(128 + base * contrast), 0, 255).astype(np.uint8)
    hidden = np.zeros(disparity.shape, dtype=bool)
    left = box[1].start
    hidden[box[0], left - round(near - far) : left] = True
    truth = make_frame(disparity, rig, image, number)
    return replace(truth, rays=HiddenRays(hidden)), box


def bad_by_edge_distance(
    disparity: np.ndarray, truth: FrameTruth, limits: tuple[int, ...] = (2, 5, 10, 20)
) -> list[float]:
    """Return ``bad_1`` in zones round the depth steps: up to each limit [px], and beyond the last."""
    filled = ~np.isnan(disparity) & ~np.isnan(truth.disparity)
    bad = filled & (np.abs(disparity - truth.disparity) > WRONG)
    shares, counted = [], np.zeros_like(filled)
    for limit in limits:
        within = near_steps(truth.disparity, STEP, limit)
        shares.append(share_of(bad, filled & within & ~counted))
        counted |= within
    return [*shares, share_of(bad, filled & ~counted)]
