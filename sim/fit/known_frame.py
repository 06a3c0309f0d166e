"""Stereo frames made from one image and its true disparity, and the sensor's output on them."""

from functools import cached_property

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.geometry.camera import Camera
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.config import Tier
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.color.image_noise import ReadNoise, ShotNoise
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.effects import AFTER_MATCHING
from digs_warp.sim.sensor.effects.disparity_errors import Speckle
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.filters import sampled
from digs_warp.sim.sensor.frame import FrameTruth, Motion, Sensed
from digs_warp.sim.sensor.infrared.pair import in_three_channels
from digs_warp.sim.sensor.tiers import sense


def right_image(left: np.ndarray, disparity: np.ndarray) -> np.ndarray:
    """Return what the right eye sees of a wall, (height, width, 3), uint8; beyond the left image: mirrored.

    Args:
        left: sRGB, (height, width, 3), uint8.
        disparity: true one of the left image [px], (height, width), nearly affine.
    """
    rows, columns = (np.asarray(each) for each in np.indices(disparity.shape))
    shift = disparity / (1 - np.gradient(disparity, axis=1))
    return sampled(left, columns + shift, rows)


# Noise of the images, and what acts on matches, are as strong as the rig says; a drift is in the frame.
ON_IMAGES = (ShotNoise(), ReadNoise())
# Not speckle: what changes between frames comes from the noise of the images here, which the wall tells.
ON_DEPTH = tuple(effect.name for effect in AFTER_MATCHING if effect.name != Speckle.name)


def sense_frame(
    frame: FrameTruth, tier: Tier = "guided", seed: int = 0, gray: bool = False
) -> tuple[tuple[np.ndarray, np.ndarray], Sensed]:
    """Return the two images as recorded, and what the sensor measures on them.

    Args:
        frame: what the eyes see; its rig has the figures.
        tier: of the sensor.
        seed: of the noise.
        gray: the eyes see no color, as those of an infrared pair: the noise of a pixel is one value. Three
            independent ones have a third less on their brightness, which is matched.
    """
    recorded = recorded_images(frame, ON_IMAGES, seed, is_gray=gray)
    if gray:
        left, right = map(in_three_channels, recorded)
        recorded = left, right
    choices = [Choice(name, True, "", "", "") for name in ON_DEPTH]
    return recorded, sense(frame, tier, choices, seed, recorded=recorded)


def is_gray(images: np.ndarray) -> bool:
    """Whether recorded images, (..., 3), are of eyes without color; noise of others differs by channel."""
    return bool((images == images[..., :1]).all())


# Surfaces are the same when their disparities differ by no more than this [px].
SAME_SURFACE = 1.0


class WarpedRays:
    """The rays of a frame with known disparity only: all surfaces are opaque and reflect nothing."""

    def __init__(self, disparity: np.ndarray) -> None:
        self._disparity = disparity

    def right_visibility(
        self, where: np.ndarray | None = None, depth: np.ndarray | None = None
    ) -> np.ndarray:
        """Whether a pixel is in front when all pixels are moved into the right image."""
        return self._right_visibility if where is None else self._right_visibility | ~where

    @cached_property
    def _right_visibility(self) -> np.ndarray:
        disparity = self._disparity
        height, width = disparity.shape
        front = np.full((height, width + 2), -np.inf)
        rows, columns = np.nonzero(~np.isnan(disparity))
        value = disparity[rows, columns]
        order = np.argsort(value)  # the nearest is written last
        rows, columns, value = rows[order], columns[order], value[order]
        target = columns - value
        # Both neighbors: adjacent pixels of a slanted surface can land two pixels apart.
        for column in (np.floor(target), np.ceil(target)):
            inside = (column >= 0) & (column < width)
            np.maximum.at(front, (rows[inside], column[inside].astype(int)), value[inside])
        landing = np.round(target)
        inside = landing >= 0
        visible = np.ones(disparity.shape, dtype=bool)
        ahead = front[rows[inside], landing[inside].astype(int)]
        visible[rows[inside], columns[inside]] = ahead <= value[inside] + SAME_SURFACE
        return visible

    def reflection_distance(self, where: np.ndarray | None = None) -> np.ndarray:
        """Unknown for a recorded pair."""
        raise DigsError("a pair of images has no information about reflections")

    def depth_behind(self, where: np.ndarray | None = None) -> np.ndarray:
        """Unknown for a recorded pair."""
        raise DigsError("a pair of images has no information about what lies behind its surfaces")


def known_frame(
    left: np.ndarray,
    right: np.ndarray,
    disparity: np.ndarray,
    rig: StereoRig,
    number: int = 0,
    drift: Drift = NO_DRIFT,
) -> FrameTruth:
    """Return a pair with true disparity as a frame of the simulator.

    Args:
        left: image, sRGB, (height, width, 3), uint8.
        right: likewise.
        disparity: true one of the left image [px], (height, width), NaN where it is not known.
        rig: the camera.
        number: of the frame, >= 0.
        drift: of the eye that saw ``right``.
    """
    shape = disparity.shape
    return FrameTruth(
        number=number,
        camera=Camera(rig.intrinsics, np.eye(4)),
        rig=rig,
        image=np.ascontiguousarray(left),
        right=np.ascontiguousarray(right),
        depth=(rig.focal_baseline / np.asarray(disparity, np.float64)).astype(np.float32),
        normals_world=np.broadcast_to(np.array([0, 0, -1], np.float32), (*shape, 3)),
        material_ids=np.zeros(shape, dtype=np.int32),
        materials=(Material("unknown", np.full(3, 0.5, dtype=np.float32)),),
        motion=Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        rays=WarpedRays(disparity),
        drift=drift,
    )
