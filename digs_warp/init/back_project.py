"""Pixels with depth -> colored points in the world, summed per voxel (paper eq. 8 and 10).

The kernel back-projects a view's pixels straight into a hash of voxels. One thread processes a whole view in
a fixed order, so the sums do not depend on the number of threads; views run in parallel. Neighboring pixels
mostly fall into the same voxel, which is then not looked up again. Positions and sums are float64: the same
bits as the NumPy version in the tests.
"""

import numpy as np
import warp as wp

from digs_warp.checks import DigsError, check_positive
from digs_warp.device.kernel_options import unfused_module_options
from digs_warp.device.parallel import launch_here
from digs_warp.geometry.camera import Camera
from digs_warp.init.edges import on_device
from digs_warp.init.voxel import BITS, COLOR, COLUMNS, MAX_INDEX, Voxels

# Fused multiply-adds would change bits.
wp.set_module_options(unfused_module_options())

# What the kernel reports: done, the table is too small, or a point is too far from the origin.
DONE, TABLE_FULL, TOO_FAR = 0, 1, 2
STATUS, VOXELS = 0, 1  # places in `report`

_BITS = wp.constant(wp.int64(BITS))
_MAX = wp.constant(float(MAX_INDEX))
_OFFSET = wp.constant(MAX_INDEX + 1)
# 2^64 divided by the golden ratio, as a signed number: the multiplier of Fibonacci hashing.
_GOLDEN = wp.constant(wp.int64(-7046029254386353131))
_TABLE_FULL = wp.constant(TABLE_FULL)
_TOO_FAR = wp.constant(TOO_FAR)


@wp.func
def slot_of(key: wp.int64, slot_bits: int) -> int:
    """Return the first slot to probe."""
    mixed = (key * _GOLDEN) >> wp.int64(64 - slot_bits)
    return int(mixed) & ((1 << slot_bits) - 1)


@wp.func
def add_to(
    sums: wp.array2d[wp.float64],
    voxel: int,
    count: wp.float64,
    point: wp.vec3d,
    color: wp.vec3d,
):
    """Add pixels to the sums of a voxel."""
    sums[voxel, 0] = sums[voxel, 0] + count
    for axis in range(3):
        sums[voxel, 1 + axis] = sums[voxel, 1 + axis] + point[axis]
        sums[voxel, 4 + axis] = sums[voxel, 4 + axis] + color[axis]


@wp.kernel
def accumulate_kernel(
    # The pixels of a view, in flat arrays: an index is checked once, not once per axis.
    height: int,
    width: int,
    depth: wp.array[float],  # [height * width]
    image: wp.array[wp.uint8],  # [height * width * 3] sRGB
    keep: wp.array[wp.bool],  # [height * width]
    # Rays in the world, per unit of depth.
    center: wp.vec3d,  # of the camera
    corner_ray: wp.vec3d,  # to the pixel (0, 0) (not its center)
    right_ray: wp.vec3d,  # change per pixel to the right
    down_ray: wp.vec3d,  # and downwards
    voxels_per_metre: wp.float64,
    slot_bits: int,  # the hash table has 2^slot_bits slots
    # outputs
    slots: wp.array[int],  # [2^slot_bits] index of a voxel + 1; 0: free
    keys: wp.array[wp.int64],  # [capacity]
    sums: wp.array2d[wp.float64],  # [capacity, 1 + 6] number of pixels, position, color
    report: wp.array[int],  # [2]
):
    """Sum all kept pixels, per voxel. One thread."""
    capacity = keys.shape[0]
    found = int(0)
    voxel = int(-1)
    last_key = wp.int64(-1)
    # The sums of the current voxel since it was entered.
    count = wp.float64(0.0)
    point_sum = wp.vec3d()
    color_sum = wp.vec3d()
    for row in range(height):
        row_ray = corner_ray + down_ray * (wp.float64(row) + wp.float64(0.5))
        for column in range(width):
            pixel = row * width + column
            if keep[pixel]:
                ray = row_ray + right_ray * (wp.float64(column) + wp.float64(0.5))
                point = center + ray * wp.float64(depth[pixel])
                cell = point * voxels_per_metre
                i = wp.floor(cell[0])
                j = wp.floor(cell[1])
                k = wp.floor(cell[2])
                if not wp.max(wp.max(wp.abs(i), wp.abs(j)), wp.abs(k)) < wp.float64(_MAX):
                    report[0] = _TOO_FAR
                    return
                key = wp.int64(i) + wp.int64(_OFFSET)
                key = (key << _BITS) | (wp.int64(j) + wp.int64(_OFFSET))
                key = (key << _BITS) | (wp.int64(k) + wp.int64(_OFFSET))
                if key != last_key:
                    if voxel >= 0:
                        add_to(sums, voxel, count, point_sum, color_sum)
                    count = wp.float64(0.0)
                    point_sum = wp.vec3d()
                    color_sum = wp.vec3d()
                    last_key = key
                    slot = slot_of(key, slot_bits)
                    voxel = slots[slot] - 1
                    while voxel >= 0 and keys[voxel] != key:
                        slot = (slot + 1) & ((1 << slot_bits) - 1)
                        voxel = slots[slot] - 1
                    if voxel < 0:
                        if found == capacity:
                            report[0] = _TABLE_FULL
                            return
                        voxel = found
                        found += 1
                        slots[slot] = found
                        keys[voxel] = key
                color = wp.vec3d(
                    wp.float64(image[3 * pixel]),
                    wp.float64(image[3 * pixel + 1]),
                    wp.float64(image[3 * pixel + 2]),
                )
                count += wp.float64(1.0)
                point_sum += point
                color_sum += color
    if voxel >= 0:
        add_to(sums, voxel, count, point_sum, color_sum)
    report[1] = found


FIRST_SLOT_BITS = 17


def back_project(
    camera: Camera,
    image: np.ndarray,
    depth: np.ndarray,
    keep: np.ndarray,
    voxel_size: float,
) -> Voxels:
    """Back-project the kept pixels and sum them per voxel of the world's grid.

    Args:
        camera: the camera of the view, of the same size as the arrays.
        image: sRGB, shape (height, width, 3), uint8.
        depth: planar depth [m], shape (height, width); finite in the kept pixels.
        keep: which pixels, shape (height, width), bool.
        voxel_size: edge length [m].

    Raises:
        DigsError: the voxel size is not positive, or so small that voxel indices overflow.
    """
    check_positive("voxel size", voxel_size)
    k, axes = camera.intrinsics, camera.world_from_cam[:3, :3]
    rays = (axes @ [-k.cx / k.fx, -k.cy / k.fy, 1.0], axes[:, 0] / k.fx, axes[:, 1] / k.fy)
    inputs = [
        *depth.shape,
        *(_flat(depth, np.float32), _flat(image, np.uint8), _flat(keep, np.bool_)),
        *(wp.vec3d(*vector) for vector in (camera.center_world, *rays)),
        1.0 / voxel_size,
    ]
    slot_bits = FIRST_SLOT_BITS
    while True:
        capacity = 1 << (slot_bits - 1)  # half as many voxels as slots
        slots, keys = np.zeros(1 << slot_bits, np.int32), np.zeros(capacity, np.int64)
        sums, report = np.zeros((capacity, COLUMNS)), np.zeros(2, np.int32)
        table = [slot_bits, *map(on_device, (slots, keys, sums, report))]
        launch_here(accumulate_kernel, 1, [*inputs, *table])
        if report[STATUS] == TOO_FAR:
            raise _too_far(camera, depth, keep, voxel_size)
        if report[STATUS] == DONE:
            order = np.argsort(keys[: report[VOXELS]])
            sums = sums[order]
            sums[:, COLOR:] /= 255.0
            return Voxels(voxel_size, keys[order], sums)
        slot_bits += 1


def _flat(array: np.ndarray, dtype: type) -> wp.array:
    return on_device(np.ascontiguousarray(array, dtype=dtype).reshape(-1))


def _too_far(camera: Camera, depth: np.ndarray, keep: np.ndarray, voxel_size: float) -> DigsError:
    away, deepest = float(np.abs(camera.center_world).max()), float(depth[keep].max())
    return DigsError(
        f"voxel size {voxel_size:g} m: too small for a camera {away:g} m from the origin that sees up to "
        f"{deepest:g} m, expected at least {(away + deepest) / MAX_INDEX:.2g} m. Check that depth and poses "
        "are in metres; estimated poses may be wrong (--poses sfm): try --poses rgbd, which uses the depth"
    )
