"""Masks of glass: depth measures what is behind it, and no other view may take a right mask away."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.masks.votes import AGREES, contradicted, in_hull, mask_votes
from digs_warp.measure.thumbnails import SmallDepth

# Balls (center, radius) [m] before a wall at y = 0.5: one of glass, and what it stands on.
GLASS = np.array([0.0, 0.0, 0.0]), 0.12
FOOT = np.array([0.0, 0.0, -0.14]), 0.12
WALL = 0.25


def behind(rays: np.ndarray, eye: np.ndarray, ball: tuple[np.ndarray, float]) -> np.ndarray:
    """How far along each ray, in its lengths, a ball is; infinity where it is not hit."""
    away = eye - ball[0]
    a, b = (rays**2).sum(axis=-1), rays @ away
    root = b**2 - a * (away @ away - ball[1] ** 2)
    return np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)


def lamp_seen_from(degrees: float, number: int) -> SmallDepth:
    """What a camera on an arc measures: the foot, and the wall through the glass."""
    angle = np.radians(degrees)
    eye = np.array([np.sin(angle), -np.cos(angle), 0.35])
    camera = Camera(Intrinsics.from_fov(96, 72, 40.0), look_at(eye, np.zeros(3), np.eye(3)[2]))
    k = camera.intrinsics
    px = pixel_centers(k.width, k.height)
    rays = camera.unproject(px, np.ones(px.shape[:2])) - eye  # planar depth 1
    foot = behind(rays, eye, FOOT)
    wall = (WALL - eye[1]) / rays[..., 1]
    return SmallDepth(
        number=number,
        camera=camera,
        depth=np.minimum(foot, wall).astype(np.float32),
        mask=np.isfinite(foot) | np.isfinite(behind(rays, eye, GLASS)),
    )


LAMP = [lamp_seen_from(degrees, n) for n, degrees in enumerate(np.linspace(-40, 40, 16))]


def masked(number: int, mask: np.ndarray) -> Sequence[SmallDepth]:
    return [replace(each, mask=mask) if each.number == number else each for each in LAMP]


def test_no_right_mask_of_glass_is_contradicted() -> None:
    votes = mask_votes(LAMP)
    # Without a look for glass, some would be.
    doubted = [each.without_glass for each in votes if each.agreement < AGREES]
    assert len(doubted) == 6 and min(doubted) > 0.8
    assert contradicted(votes) == []


def test_the_hull_is_what_most_of_the_views_that_look_there_have_in_their_masks() -> None:
    points = np.array([GLASS[0], FOOT[0], [0.0, WALL, 0.0], [0.3, 0.0, 0.0]])
    back = np.diag([-1.0, 1.0, -1.0, 1.0])
    away = [
        replace(each, camera=replace(each.camera, world_from_cam=each.camera.world_from_cam @ back))
        for each in LAMP
    ]
    assert in_hull(points, [*LAMP, *away]).tolist() == [True, True, False, False]
    assert not in_hull(points, LAMP[:2]).any()  # too few to say so


def test_a_mask_with_wall_beside_the_glass_is_contradicted() -> None:
    mask = LAMP[4].mask
    assert mask is not None
    assert contradicted(mask_votes(masked(4, mask | (np.arange(96) > 60)))) == [4]
