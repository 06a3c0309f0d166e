"""Pixels with depth -> colored points in the world, summed per voxel (paper eq. 8 and 10)."""

from typing import Any

import numpy as np
import warp as wp

from digs_warp.checks import DigsError, check_positive
from digs_warp.device.parallel import launch_here, packed
from digs_warp.geometry.camera import Camera
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
    PixelRays,
    PixelValues,
    VoxelTable,
    accumulate_kernel,
)

FIRST_SLOT_BITS = 16


def back_project(
    camera: Camera,
    image: np.ndarray,
    depth: np.ndarray,
    keep: np.ndarray,
    voxel_size: float,
    extra: np.ndarray | None = None,
) -> VoxelSums:
    """Back-project the kept pixels and sum them per voxel of the world's grid.

    Args:
        camera: the camera of the view, of the same size as the arrays.
        image: sRGB, shape (height, width, 3), uint8.
        depth: planar depth [m], shape (height, width); finite in the kept pixels.
        keep: which pixels, shape (height, width), bool.
        voxel_size: edge length [m].
        extra: further values per pixel to sum, shape (height, width, k).

    Raises:
        DigsError: the voxel size is not positive, or so small that voxel indices overflow.
    """
    check_positive("voxel size", voxel_size)
    channels = 0 if extra is None else extra.shape[2]
    flat_extra = np.zeros((0, 0)) if extra is None else extra.reshape(-1, channels)
    pixels = packed(
        PixelValues,
        height=depth.shape[0],
        width=depth.shape[1],
        depth=_flat(depth, np.float32),
        image=_flat(image, np.uint8),
        keep=_flat(keep, np.bool_),
        extra=on_device(np.ascontiguousarray(flat_extra, dtype=np.float32)),
    )
    inputs = [pixels, _pixel_rays(camera), 1.0 / voxel_size]
    slot_bits = FIRST_SLOT_BITS
    while True:
        table = _empty_table(slot_bits, channels)
        arrays = {name: on_device(array) for name, array in table.items()}
        output = packed(VoxelTable, slot_bits=slot_bits, **arrays)
        launch_here(accumulate_kernel, 1, [*inputs, output])
        if table["report"][STATUS] == TOO_FAR:
            raise _too_far(camera, depth, keep, voxel_size)
        if table["report"][STATUS] == DONE:
            return _sums_of(table)
        slot_bits += 1


def _pixel_rays(camera: Camera) -> Any:
    """Return the camera's `PixelRays`."""
    k = camera.intrinsics
    axes = camera.world_from_cam[:3, :3]
    return packed(
        PixelRays,
        center=wp.vec3d(*camera.center_world),
        corner=wp.vec3d(*(axes @ [-k.cx / k.fx, -k.cy / k.fy, 1.0])),
        right=wp.vec3d(*(axes[:, 0] / k.fx)),
        down=wp.vec3d(*(axes[:, 1] / k.fy)),
    )


def _empty_table(slot_bits: int, channels: int) -> dict[str, np.ndarray]:
    """Return the arrays of a `VoxelTable` that holds half as many voxels as it has slots."""
    capacity = 1 << (slot_bits - 1)
    return {
        "slots": np.zeros(1 << slot_bits, np.int32),
        "keys": np.zeros(capacity, np.int64),
        "sums": np.zeros((capacity, 1 + EXTRA + channels)),
        "report": np.zeros(2, np.int32),
    }


def _sums_of(table: dict[str, np.ndarray]) -> VoxelSums:
    """Return the voxels of a table in the order of their keys."""
    found = int(table["report"][VOXELS])
    keys = table["keys"][:found]
    order = np.argsort(keys)
    sums = table["sums"][:found][order]
    sums[:, 1 + COLOR : 1 + EXTRA] /= 255.0
    return VoxelSums(keys[order], sums)


def _flat(array: np.ndarray, dtype: type) -> wp.array:
    return on_device(np.ascontiguousarray(array, dtype=dtype).reshape(-1))


def _too_far(camera: Camera, depth: np.ndarray, keep: np.ndarray, voxel_size: float) -> DigsError:
    away, deepest = float(np.abs(camera.center_world).max()), float(depth[keep].max())
    extent = away + deepest
    found = (
        f"voxel size {voxel_size:g} m: too small for points up to {extent:g} m from the origin, expected at "
        f"least {extent / MAX_INDEX:.2g} m"
    )
    if away > deepest:
        return DigsError(
            f"{found}. The camera itself is {away:g} m from the origin: the poses are wrong, or not in "
            "metres. Recorded poses: check their unit and move the origin near the cameras. Estimated ones "
            "(--poses sfm): try --poses rgbd, which uses the depth, or --poses capture for recorded ones"
        )
    return DigsError(f"{found}; choose a larger voxel size, or check that the depth is in metres")
