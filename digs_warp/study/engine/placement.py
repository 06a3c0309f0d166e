"""Where a result lies as a whole: estimated and refined poses leave one rigid motion of everything open.

Nothing in the images shows it. A result that lies 3 mm beside the truth misses most of its texture in views
of a camera at a true pose, however sharp it is. So its quality is also measured after that one motion, as is
usual for estimated poses (Lin et al. 2021, BARF, section 4.2).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.rigid import invert_rigid, laid_over, transform_points

# Of a result's centers, these many tell where it lies.
POINTS = 1000


def motion_to_truth(
    posed: Sequence[Frame], recorded: Sequence[Frame], gaussians: Gaussians
) -> np.ndarray:
    """Return the rigid motion, (4, 4), that takes a result to where its views with true poses have it.

    Each view with its found pose sees the result at a place before its camera; with its true pose, that place
    is elsewhere in the world. The motion fits the mean over the views, at the Gaussians' centers.

    Args:
        posed: the frames that the result was made from, with their final poses.
        recorded: the recording, whose poses are true; frames belong together by their names.
        gaussians: the result, at least three in different places.
    """
    true = {frame.name: frame.camera.world_from_cam for frame in recorded}
    chosen = evenly(range(len(gaussians)), POINTS)
    points = gaussians.means[chosen].astype(np.float64)
    moved = [
        transform_points(true[frame.name] @ frame.camera.cam_from_world, points) for frame in posed
    ]
    return laid_over(points, np.mean(moved, axis=0))


def seen_in_place(frames: Sequence[Frame], to_truth: np.ndarray) -> list[Frame]:
    """Return true views as they see a result that was not moved to its place."""
    back = invert_rigid(to_truth)
    return [
        replace(f, camera=replace(f.camera, world_from_cam=back @ f.camera.world_from_cam))
        for f in frames
    ]


def mesh_in_place(truth: TriangleMesh, to_truth: np.ndarray) -> TriangleMesh:
    """Return the true mesh where a result that was not moved to its place has it."""
    return replace(truth, points_world=transform_points(invert_rigid(to_truth), truth.points_world))
