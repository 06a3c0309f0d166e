"""Poses with random errors of a stated size."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from digs_warp.data.capture import Capture
from digs_warp.data.frame import posed_at
from digs_warp.geometry.rigid import rigid


def perturbed_poses(
    world_from_cams: Sequence[np.ndarray],
    rotation_error_deg: float,
    translation_error: float,
    seed: int,
) -> list[np.ndarray]:
    """Return the poses, each turned and moved by normal errors of these deviations [degree, m] per axis.

    The same seed gives the same directions at every size of the error.
    """
    rng = np.random.default_rng(seed)
    turns = rng.normal(size=(len(world_from_cams), 3)) * np.deg2rad(rotation_error_deg)
    shifts = rng.normal(size=(len(world_from_cams), 3)) * translation_error
    rotations = Rotation.from_rotvec(turns).as_matrix()
    return [
        rigid(pose[:3, :3] @ turn, pose[:3, 3] + shift)
        for pose, turn, shift in zip(world_from_cams, rotations, shifts, strict=True)
    ]


def perturbed_capture(
    capture: Capture,
    rotation_error_deg: float = 0.5,
    translation_error: float = 0.005,
    seed: int = 0,
) -> Capture:
    """Return the recording with `perturbed_poses`."""
    given = [frame.camera.world_from_cam for frame in capture.frames]
    wrong = perturbed_poses(given, rotation_error_deg, translation_error, seed)
    return replace(capture, frames=tuple(posed_at(capture.frames, wrong)))
