"""How far found poses move the object in the images: a world laid elsewhere or larger moves nothing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.sfm_model import scaled_pose
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import matrix_from_rotation_vector, rigid
from digs_warp.study.engine.placement import pose_pixels
from reference.textured_plane import INTRINSICS, picture, ring_of_poses


def frame(number: int, pose: np.ndarray) -> Frame:
    depth = picture(pose).depth
    mask = np.full(depth.shape, 255, np.uint8)
    image = np.zeros((*depth.shape, 3), np.uint8)
    layers = {Layer.IMAGE: image, Layer.DEPTH_TRUE: depth, Layer.MASK: mask}
    return Frame(f"{number:04d}", Camera(INTRINSICS, pose), 0.1 * number, layers)


FRAMES = [frame(number, pose) for number, pose in enumerate(ring_of_poses(8))]


def moved(motions: Sequence[np.ndarray], scale: float = 1.0) -> list[Frame]:
    return [
        replace(
            each,
            camera=replace(
                each.camera, world_from_cam=motion @ scaled_pose(each.camera, 1 / scale)
            ),
        )
        for each, motion in zip(FRAMES, motions, strict=True)
    ]


def test_a_similarity_of_all_is_no_error_and_its_scale_is_told() -> None:
    motion = rigid(
        matrix_from_rotation_vector(np.array([0.4, -0.2, 1.0])), np.array([1.0, 2.0, 3.0])
    )
    found = pose_pixels(FRAMES, moved([motion] * 8, 1.02))
    assert found.error < 1e-3
    assert found.scale == pytest.approx(1.02, abs=1e-5)


def test_a_turned_camera_counts_by_the_pixels_that_it_moves() -> None:
    motions = [np.eye(4) for _ in FRAMES]
    pose = FRAMES[3].camera.world_from_cam
    degrees = 0.5
    turn = rigid(
        matrix_from_rotation_vector(np.array([0.0, np.radians(degrees), 0.0])), np.zeros(3)
    )
    motions[3] = pose @ turn @ np.linalg.inv(pose)
    px = INTRINSICS.fx * np.radians(degrees)
    # Of one camera of eight, and a little more away from the middle of the image.
    expected = px / np.sqrt(8)
    assert pose_pixels(FRAMES, moved(motions)).error == pytest.approx(expected, rel=0.2)


def test_frames_that_were_left_out_do_not_count() -> None:
    found = pose_pixels(FRAMES, moved([np.eye(4)] * 8, 1.02)[1:])
    assert found.error < 1e-3
    assert found.scale == pytest.approx(1.02, abs=1e-5)
