"""Errors put into masks and poses, of a stated size: how much does everything after them depend on them?

Masks get the errors that segmentation makes, as the paper shows in its figure 6: wrong borders, leaks into
the surround, missing pieces. Their sizes are shares of the object's size in the image (the root of its area),
so that an error means the same at every resolution.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame, posed_at
from digs_warp.data.images import write_image
from digs_warp.geometry.rigid import rigid

# At strength 1: displacement of the border (RMS), and radius of a leak or a missing piece.
BORDER_SHIFT = 0.012
PATCH_RADIUS = 0.09

# The border wanders over this length; so does the outline of a patch.
WANDER = 0.25
PATCHES_EACH = 2  # leaks, and as many missing pieces


def degrade_mask(mask: np.ndarray, strength: float, seed: tuple[int, ...]) -> np.ndarray:
    """Return the mask with errors, shape (height, width), uint8; strength 0 returns it unchanged.

    Args:
        mask: shape (height, width), uint8, 0 to 255.
        strength: factor on all sizes, >= 0.
        seed: for example (seed of the run, number of the frame).
    """
    import cv2

    size = float(np.sqrt(np.count_nonzero(mask > 127)))
    if size == 0 or strength == 0:
        return mask.copy()
    rng = np.random.default_rng(seed)
    height, width = mask.shape
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    shift = strength * BORDER_SHIFT * size
    du, dv = (shift * smooth_noise(mask.shape, WANDER * size, rng) for _ in range(2))
    spoilt = cv2.remap(mask, u + du, v + dv, cv2.INTER_LINEAR)
    border = border_pixels(mask)
    radius = strength * PATCH_RADIUS * size
    for number in range(2 * PATCHES_EACH):
        row, column = border[rng.integers(len(border))]
        outline = radius * (1.0 + 0.4 * smooth_noise(mask.shape, 2 * radius + 2, rng))
        distance = np.hypot(u - column, v - row)
        patch = (np.clip(outline - distance + 0.5, 0.0, 1.0) * 255).astype(np.uint8)
        leaks = number < PATCHES_EACH
        spoilt = np.maximum(spoilt, patch) if leaks else np.minimum(spoilt, 255 - patch)
    return spoilt


def write_degraded_masks(frames: Sequence[Frame], strength: float, seed: int, folder: Path) -> None:
    """Write the degraded mask of every frame as NAME.png, for ``--masks folder``."""
    for number, frame in enumerate(frames):
        mask = degrade_mask(frame.load_mask(), strength, (seed, number))
        write_image(folder / f"{frame.name}.png", mask)


def border_pixels(mask: np.ndarray) -> np.ndarray:
    """Return (row, column) of the object's outermost pixels, shape (n, 2); needs an object."""
    import cv2

    inside = (mask > 127).astype(np.uint8)
    # Where the image ends, the object does not: unless it fills the image.
    border = np.argwhere(inside > cv2.erode(inside, np.ones((3, 3), np.uint8), borderValue=1))
    return border if len(border) else np.argwhere(inside)


def smooth_noise(shape: tuple[int, ...], length: float, rng: np.random.Generator) -> np.ndarray:
    """Return normal noise that changes over ``length`` pixels, unit variance at the nodes, float32."""
    import cv2

    height, width = shape
    nodes = tuple(int(np.ceil(side / max(length, 2.0))) + 3 for side in (height, width))
    coarse = rng.normal(size=nodes).astype(np.float32)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)


def perturbed_poses(
    world_from_cams: Sequence[np.ndarray],
    rotation_error_deg: float,
    translation_error: float,
    seed: int,
) -> list[np.ndarray]:
    """Return the poses (4, 4), each turned and moved by an independent normal error.

    Args:
        world_from_cams: the poses, (4, 4) each.
        rotation_error_deg: standard deviation of the rotation vector's components, about the camera's
            center [degree].
        translation_error: standard deviation of the center along each axis [m].
        seed: the same seed gives the same directions at every size of the error.
    """
    from scipy.spatial.transform import Rotation

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
