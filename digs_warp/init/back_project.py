"""Pixels with depth -> coloured points in the world, summed up per voxel (paper eq. 8 and 10)."""

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.checks import DigsError, check_positive
from digs_warp.init.edges import on_device
from digs_warp.init.voxel import VoxelSums
from digs_warp.init.voxel_kernel import (
    COLOR,
    DONE,
    EXTRA,
    MAX_INDEX,
    STATUS,
    TOO_FAR,
    VOXELS,
    accumulate_kernel,
)

FIRST_SLOT_BITS = 16


def back_project(
    camera: Camera,
    image: np.ndarray,
    depth: np.ndarray,
    weights: np.ndarray,
    voxel_size: float,
    extra: np.ndarray | None = None,
) -> VoxelSums:
    """Back-project the pixels that have a weight and sum them up per voxel of the world's grid.

    Args:
        camera: the camera of the view; its size is that of the arrays.
        image: sRGB, shape (height, width, 3), uint8.
        depth: planar depth [m], shape (height, width); finite wherever there is a weight.
        weights: of each pixel, shape (height, width), float32, finite; 0 leaves it out.
        voxel_size: edge length [m].
        extra: further values per pixel to sum up, shape (height, width, k).

    Raises:
        DigsError: the voxel size is not positive, or so small that voxel indices overflow.
    """
    check_positive("voxel size", voxel_size)
    height, width = depth.shape
    channels = 0 if extra is None else extra.shape[2]
    flat_extra = np.zeros((0, 0)) if extra is None else extra.reshape(-1, channels)
    k = camera.intrinsics
    axes = camera.world_from_cam[:3, :3]
    corner = axes @ [-k.cx / k.fx, -k.cy / k.fy, 1.0]
    inputs = [
        _flat(depth, np.float32),
        _flat(image, np.uint8),
        _flat(weights, np.float32),
        on_device(np.ascontiguousarray(flat_extra, dtype=np.float32)),
        height,
        width,
        wp.vec3d(*camera.center_world),
        wp.vec3d(*corner),
        wp.vec3d(*(axes[:, 0] / k.fx)),
        wp.vec3d(*(axes[:, 1] / k.fy)),
        1.0 / voxel_size,
    ]
    slot_bits = FIRST_SLOT_BITS
    while True:
        capacity = 1 << (slot_bits - 1)
        keys, counts = np.zeros(capacity, np.int64), np.zeros(capacity, np.int64)
        sums = np.zeros((capacity, 1 + EXTRA + channels))
        slots, report = np.zeros(1 << slot_bits, np.int32), np.zeros(2, np.int32)
        outputs = [on_device(array) for array in (slots, keys, counts, sums, report)]
        wp.launch(
            accumulate_kernel, dim=1, inputs=[*inputs, slot_bits], outputs=outputs, device="cpu"
        )
        if report[STATUS] == TOO_FAR:
            raise _too_far(camera, depth, weights, voxel_size)
        if report[STATUS] == DONE:
            break
        slot_bits += 1
    found = int(report[VOXELS])
    order = np.argsort(keys[:found])
    sums = sums[:found][order]
    sums[:, 1 + COLOR : 1 + EXTRA] /= 255.0
    return VoxelSums(keys[:found][order], counts[:found][order], sums)


def _flat(array: np.ndarray, dtype: type) -> wp.array:
    return on_device(np.ascontiguousarray(array, dtype=dtype).reshape(-1))


def _too_far(
    camera: Camera, depth: np.ndarray, weights: np.ndarray, voxel_size: float
) -> DigsError:
    extent = float(np.abs(camera.center_world).max() + depth[weights > 0].max())
    return DigsError(
        f"voxel size {voxel_size:g} m: too small for points up to {extent:g} m from the origin, "
        f"expected at least {extent / MAX_INDEX:.2g} m; choose a larger voxel size, or check that the "
        "depth is in metres"
    )
