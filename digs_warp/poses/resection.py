"""Where a frame was taken, from matched features that other frames measure in the world."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid, rigid, transform_points
from digs_warp.poses.features import FEWEST, WITHIN, Features, matched, reprojection_errors
from digs_warp.poses.views import Picture

# Draws of three matches. In every other one near points come first: a camera that turns by a little less and
# shifts by a little more sees all that is far at the same pixels, and only few matches are near.
DRAWS = 600
# A match that misses by more is wrong, and misses by this [px].
WRONG = WITHIN


@dataclass(frozen=True, eq=False)
class Sightings:
    """Points in the world, and where a frame sees them; some are matched wrongly.

    Attributes:
        points_world: (n, 3) [m].
        px: pixel centers at +0.5, (n, 2).
        camera: of the frame.
        nearness: weights of the points in draws, (n,), sum 1.
    """

    points_world: np.ndarray
    px: np.ndarray
    camera: Intrinsics
    nearness: np.ndarray

    @staticmethod
    def of(
        picture: Picture, features: Features, others: Sequence[tuple[Features, np.ndarray]]
    ) -> "Sightings":
        """Match a frame with others.

        Args:
            picture: of the frame.
            features: of the frame.
            others: features and ``world_from_cam`` of each other frame, with depth; at least one.
        """
        found = [(matched(each, features, picture.intrinsics), pose) for each, pose in others]
        world = [transform_points(pose, each.points) for each, pose in found]
        depth = np.concatenate([each.points[:, 2] for each, _ in found])
        near = 1 / depth**2
        px = np.concatenate([each.px for each, _ in found])
        return Sightings(np.concatenate(world), px, picture.intrinsics, near / near.sum())

    def placings(self, most: int) -> list[np.ndarray]:
        """Return at most this many ``world_from_cam`` that miss few points, the best first."""
        import cv2

        if len(self.px) < FEWEST:
            return []
        matrix = self.camera.matrix
        rng, found = np.random.default_rng(0), []
        for number in range(DRAWS):
            weights = self.nearness if number % 2 else None
            drawn = rng.choice(len(self.px), 3, replace=False, p=weights)
            points, px = self.points_world[drawn], self.px[drawn]
            _, turns, shifts = cv2.solveP3P(points, px, matrix, None, cv2.SOLVEPNP_AP3P)  # pyright: ignore[reportArgumentType, reportCallIssue]
            for turn, shift in zip(turns, shifts, strict=True):
                motion = rigid(cv2.Rodrigues(turn)[0], shift[:, 0])
                if np.isfinite(motion).all():
                    found.append((self._missed(motion), motion))
        found.sort(key=lambda each: each[0])
        return [invert_rigid(motion) for _, motion in found[:most]]

    def _missed(self, cam_from_world: np.ndarray) -> float:
        """Return the sum of the squares of what all points miss by [px^2]."""
        errors = reprojection_errors(self.points_world, self.px, cam_from_world, self.camera)
        return float(np.minimum(errors, WRONG**2).sum())
