"""The 'guided' tier on a frame of the simulator, with second surfaces behind glass and in mirrors."""

from collections.abc import Collection

import numpy as np

from digs_warp.sim.sensor.effects import SECOND_SURFACE_NAMES
from digs_warp.sim.sensor.effects.second_surfaces import Mirror, Transparency
from digs_warp.sim.sensor.error_attribution import attribute_errors
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import FrameTruth, Sensed, is_mirror, is_transparent
from digs_warp.sim.sensor.guided.blocks import BLOCK, BLOCKS, MAX_BLOCKS
from digs_warp.sim.sensor.guided.confidence import confidence_of
from digs_warp.sim.sensor.guided.search import search
from digs_warp.sim.sensor.matcher import search_range

# Concave mirrors can move the image to infinity or in front of the surface; this limits it [m].
MAX_VIRTUAL_DISTANCE = 100.0

# Neighbors whose depth differs by more than this share belong to different surfaces.
SAME_SURFACE = 0.05


def virtual_disparity(truth: FrameTruth, where: np.ndarray) -> np.ndarray:
    """Return the disparity [px] of what the surface reflects, (height, width), float64.

    Both eyes see the reflected object behind the surface. A flat mirror shows it as far behind as it lies
    in front; a curved one at v, where 1/v = 1/s + 2k (the mirror equation), s is the distance of the object
    and k the curvature of the surface along the baseline [1/m], positive where convex.

    Args:
        truth: its rays give the distance of the reflected object.
        where: pixels to compute, (height, width), bool; the others are NaN.
    """
    rows, columns = np.nonzero(where)
    k = truth.camera.intrinsics
    depth = truth.depth[rows, columns].astype(np.float64)
    x, y = (columns + 0.5 - k.cx) / k.fx, (rows + 0.5 - k.cy) / k.fy
    to_surface = depth * np.sqrt(1 + x * x + y * y)
    to_mirrored = truth.rays.reflection_distance(where)[rows, columns].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / to_mirrored + 2 * curvature_along_rows(truth, rows, columns)
        behind = 1 / np.maximum(inverse, 1 / MAX_VIRTUAL_DISTANCE)
        virtual_depth = depth * (to_surface + behind) / to_surface
    disparity = np.full(where.shape, np.nan)
    disparity[rows, columns] = truth.rig.intrinsics.fx * truth.rig.baseline / virtual_depth
    return disparity


def curvature_along_rows(truth: FrameTruth, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the curvature of the surface along the rows [1/m] at some pixels, shape (n,).

    Positive where convex (a sphere of radius r seen from outside: 1/r). Measured between the neighbors on
    the same surface; 0 if there are none.
    """
    last = truth.depth.shape[1] - 1
    left, right = (
        np.where(_same_surface(truth, rows, columns, side), side, columns)
        for side in (np.maximum(columns - 1, 0), np.minimum(columns + 1, last))
    )
    start, end = (
        truth.camera.unproject(
            np.stack([side + 0.5, rows + 0.5], axis=-1), truth.depth[rows, side].astype(np.float64)
        )
        for side in (left, right)
    )
    step = end - start
    turn = truth.normals_world[rows, right].astype(np.float64) - truth.normals_world[rows, left]
    length = np.sum(step * step, axis=1)
    return np.where(left < right, np.sum(turn * step, axis=1) / np.maximum(length, 1e-12), 0.0)


def _same_surface(
    truth: FrameTruth, rows: np.ndarray, columns: np.ndarray, others: np.ndarray
) -> np.ndarray:
    """Return whether pixels show the same surface as other pixels of their rows, shape (n,), bool."""
    depth = truth.depth[rows, columns]
    same_material = truth.material_ids[rows, others] == truth.material_ids[rows, columns]
    return same_material & (np.abs(truth.depth[rows, others] - depth) < SAME_SURFACE * depth)


def second_disparity(truth: FrameTruth, effects: Collection[str]) -> np.ndarray | None:
    """Return the disparity [px] of what lies behind glass or appears in mirrors, as the images show it.

    Shape (height, width), float32, NaN where there is no such material; None where none is in view: then
    no ray is cast.

    Args:
        truth: its rays find what lies behind and what is reflected.
        effects: names of those whose surfaces to look for; other names change nothing.
    """
    glass = _if_any(truth.pixels_of(is_transparent)) if Transparency.name in effects else None
    mirrors = _if_any(truth.pixels_of(is_mirror)) if Mirror.name in effects else None
    if glass is None and mirrors is None:
        return None
    second = (
        np.full(truth.depth.shape, np.nan, np.float32) if glass is None else _behind(truth, glass)
    )
    if mirrors is not None:
        reflected = virtual_disparity(truth, mirrors)
        np.copyto(second, reflected, where=mirrors, casting="same_kind")
    return truth.drift.shown_disparity(second, truth.rig.intrinsics)


def _behind(truth: FrameTruth, glass: np.ndarray) -> np.ndarray:
    """Return the disparity [px] of what shows through, (height, width), float32, NaN where nothing does."""
    # The ray goes straight on, as in the images. What a body shows bent has no such disparity.
    return np.float32(truth.rig.focal_baseline) / truth.rays.depth_behind(glass)


def _if_any(where: np.ndarray | None) -> np.ndarray | None:
    """Return the mask, None if it is empty."""
    return where if where is not None and where.any() else None


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
    surface, smoothness = truth.shown_disparity, rig.smoothness
    found = search(left, right, surface, disparities, rig.window, second, smoothness=smoothness)
    confidence = confidence_of(left, found.disparity, found.cost, found.rival, rig.window)
    disparity = truth.drift.reported_disparity(found.disparity)
    return Sensed(disparity, attribute_errors(disparity, truth), confidence)
