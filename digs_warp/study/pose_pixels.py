"""How far found poses move what a simulated recording shows, in pixels; and the scale that they have."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.rigid import matrix_from_rotation_vector
from digs_warp.poses.from_images.similarity import Similarity
from digs_warp.poses.refine.photometric_alignment import in_place

# Points of the object in each frame.
POINTS = 200


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
    rows, columns = known[:: max(1, len(known) // POINTS)].T
    px = pixel_centers(k.width, k.height)[rows, columns]
    return px, frame.camera.unproject(px, depth[rows, columns].astype(np.float64))
