"""A pair of cameras becomes one whose images have their rows in common (Fusiello et al. 2000)."""

from dataclasses import dataclass

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.formats.captures.lens import Lens, PinholeView
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import rigid

# Eyes that look this far apart, or along the line between them [cosine], are no stereo pair.
LEAST_COSINE, MOST_ALONG = 0.7, 0.7


@dataclass(frozen=True, eq=False)
class Eye:
    """A camera of a rig: its pinhole part, its lens, and where it is: body from camera, (4, 4) [m]."""

    intrinsics: Intrinsics
    lens: Lens | None
    body_from_cam: np.ndarray


@dataclass(frozen=True, eq=False)
class RectifiedPair:
    """How the images of two eyes become a rectified pair.

    Attributes:
        left, right: the views; both have the same target.
        baseline: [m].
        body_from_cam: of the rectified left camera, (4, 4) [m].
    """

    left: PinholeView
    right: PinholeView
    baseline: float
    body_from_cam: np.ndarray


def rectify(left: Eye, right: Eye, where: str) -> RectifiedPair:
    """Return the rectified pair: rows along the line between the eyes, both facing the mean of their views.

    The focal length is the mean of the eyes', so that the centers stay as sharp as they are; the principal
    point is where the middles of both images come to lie on average.

    Args:
        left: the eye whose camera the frame has.
        right: the other one.
        where: the recording, for messages.

    Raises:
        CaptureError: the eyes are in one place, look apart, or stand one behind the other.
    """
    apart = right.body_from_cam[:3, 3] - left.body_from_cam[:3, 3]
    baseline = float(np.linalg.norm(apart))
    ahead = [eye.body_from_cam[:3, 2] for eye in (left, right)]
    if not (baseline > 0 and ahead[0] @ ahead[1] > LEAST_COSINE):
        raise CaptureError(
            f"{where}: the two cameras are {baseline:.3g} m apart and look in directions with the cosine "
            f"{ahead[0] @ ahead[1]:.2f}, expected side by side and almost parallel; check T_BS"
        )
    x, forward = apart / baseline, ahead[0] + ahead[1]
    forward = forward / np.linalg.norm(forward)
    if abs(x @ forward) > MOST_ALONG or x @ left.body_from_cam[:3, 0] < 0:
        raise CaptureError(
            f"{where}: cam1 is not to the right of cam0, expected a left and a right eye; swap the folders"
        )
    y = np.cross(forward, x)
    y /= np.linalg.norm(y)
    body_from_cam = rigid(np.stack([x, y, np.cross(x, y)], axis=1), left.body_from_cam[:3, 3])
    turns = [body_from_cam[:3, :3].T @ eye.body_from_cam[:3, :3] for eye in (left, right)]
    target = _target(left, right, turns)
    views = [
        PinholeView(eye.intrinsics, eye.lens, target, tuple(turn.ravel().tolist()))
        for eye, turn in zip((left, right), turns, strict=True)
    ]
    return RectifiedPair(views[0], views[1], baseline, body_from_cam)


def _target(left: Eye, right: Eye, turns: list[np.ndarray]) -> Intrinsics:
    """Return the camera of both rectified images."""
    ks = [left.intrinsics, right.intrinsics]
    focal = float(np.mean([(k.fx, k.fy) for k in ks]))
    middles = []
    for k, turn in zip(ks, turns, strict=True):
        ray = turn @ [(k.width / 2 - k.cx) / k.fx, (k.height / 2 - k.cy) / k.fy, 1.0]
        middles.append(focal * ray[:2] / ray[2])
    cx, cy = (ks[0].width / 2, ks[0].height / 2) - np.mean(middles, axis=0)
    return Intrinsics(ks[0].width, ks[0].height, focal, focal, float(cx), float(cy))
