"""Where a result lies as a whole: estimated and refined poses leave one rigid motion of everything open.

Nothing in the images shows it. A result that lies 3 mm beside the truth misses most of its texture in views
of a camera at a true pose, however sharp it is. So its quality is also measured after that one motion, as is
usual for estimated poses (Lin et al. 2021, BARF, section 4.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.sfm_model import scaled_pose
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.rigid import (
    invert_rigid,
    laid_over,
    matrix_from_rotation_vector,
    transform_points,
)
from digs_warp.poses.from_images.similarity import Similarity
from digs_warp.poses.refine.photometric_alignment import in_place

# Points of the object in each frame.
FRAME_POINTS = 200


@dataclass(frozen=True)
class PosePixels:
    """What found poses do to the image of the object, after the similarity under which they do least.

    Attributes:
        error: root mean square over the points of all frames [px].
        scale: of the found world over the true one: above 1, found cameras are farther apart.
    """

    error: float
    scale: float


def pose_pixels(recorded: Sequence[Frame], found: Sequence[Frame]) -> PosePixels:
    """Return by how much found poses move the object in the images.

    Centers and turns of cameras, compared each for itself, overstate errors that make up for each other, and
    on a short arc the centers say little of how to lay the cameras over each other. A rendered view shows
    neither: it shows by how many pixels the surface is elsewhere.

    Args:
        recorded: frames with true poses, true depth and masks.
        found: those of them that were not left out, with found poses.
    """
    from scipy.optimize import least_squares

    by_name = {frame.name: frame for frame in recorded}
    true = [by_name[frame.name] for frame in found]
    seen = [_object_points(frame) for frame in true]
    world = np.concatenate([points for _, points in seen])
    given = np.stack([frame.camera.world_from_cam for frame in true])
    middle = world.mean(axis=0)
    distance = float(np.median(np.linalg.norm(given[:, :3, 3] - middle, axis=1)))
    laid = in_place(np.stack([frame.camera.world_from_cam for frame in found]), given, distance)
    cameras = [
        Camera(frame.camera.intrinsics, pose) for frame, pose in zip(true, laid, strict=True)
    ]

    def misses(steps: np.ndarray) -> np.ndarray:
        """Return by how much each point is off after a similarity about the middle [px], flat."""
        turn = matrix_from_rotation_vector(steps[:3])
        moved = Similarity(float(np.exp(steps[6])), turn, middle + steps[3:6])
        parts = [
            camera.project(moved.apply(points - middle))[0] - px
            for camera, (px, points) in zip(cameras, seen, strict=True)
        ]
        return np.concatenate(parts).reshape(-1)

    best = least_squares(misses, np.zeros(7), x_scale=0.01)
    apart = misses(best.x).reshape(-1, 2)
    error = float(np.sqrt((apart**2).sum(axis=1).mean()))
    return PosePixels(error, float(np.exp(best.x[6])))


def _object_points(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels of the object (n, 2), and their points in the world [m], (n, 3)."""
    depth, k = frame.load_depth_true(), frame.camera.intrinsics
    known = np.argwhere(np.isfinite(depth) & (frame.load_mask() > 127))
    rows, columns = known[:: max(1, len(known) // FRAME_POINTS)].T
    px = pixel_centers(k.width, k.height)[rows, columns]
    return px, frame.camera.unproject(px, depth[rows, columns].astype(np.float64))


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


def in_scale(frames: Sequence[Frame], scale: float) -> list[Frame]:
    """Return the frames with their cameras farther from the origin by a factor, as in a larger world."""
    return [
        replace(f, camera=replace(f.camera, world_from_cam=scaled_pose(f.camera, 1 / scale)))
        for f in frames
    ]


def mesh_in_place(truth: TriangleMesh, to_truth: np.ndarray) -> TriangleMesh:
    """Return the true mesh where a result that was not moved to its place has it."""
    return replace(truth, points_world=transform_points(invert_rigid(to_truth), truth.points_world))
