"""Kernels of `digs_warp.init.visibility`: what each view says about each point. One thread per point."""

import warp as wp

from digs_warp.device.eyes import Eye, pixel_seen, place_of, shows

wp.set_module_options({"enable_backward": False})

# Depths agree within this many voxels plus this share of the depth.
TOLERANCE_VOXELS = 2.0
TOLERANCE_SHARE = 0.01

# A view that measured the surface within the first number of voxels of a point agrees with it, and one that
# measured it within the second disagrees.
AGREES_VOXELS, NEAR_VOXELS = 1.0, 4.0

_AGREES = wp.constant(wp.float64(AGREES_VOXELS))
_NEAR = wp.constant(wp.float64(NEAR_VOXELS))
_VOXELS = wp.constant(wp.float64(TOLERANCE_VOXELS))
_SHARE = wp.constant(wp.float64(TOLERANCE_SHARE))


@wp.func
def depths_at(eye: Eye, depth: wp.array[float], point: wp.vec3d):
    """Depth [m] measured at the pixel of a point, and the point's own.

    A point outside of the image is as if infinitely far behind what was measured: it is hidden, too.
    """
    seen = pixel_seen(eye, point)
    measured = wp.float64(0.0)
    own = wp.float64(wp.inf)
    if shows(eye, seen):
        measured = wp.float64(depth[place_of(eye, seen)])
        own = seen[2]
    return measured, own


@wp.kernel
def says_kernel(
    first: int,
    points: wp.array[wp.vec3d],  # [n] in the world [m]
    eyes: wp.array[Eye],
    depth: wp.array[float],  # depth maps of all eyes [m], NaN: unknown
    voxel_size: wp.float64,  # [m]
    # output
    said: wp.array2d[int],  # [n, 3] views that confirm, contradict and cannot see a point
):
    """Count what all views say about a point; see `digs_warp.init.visibility`."""
    i = first + wp.tid()
    confirmed = int(0)
    contradicted = int(0)
    blind = int(0)
    for e in range(eyes.shape[0]):
        measured, own = depths_at(eyes[e], depth, points[i])
        nearer = measured - own
        tolerance = _VOXELS * voxel_size + _SHARE * measured
        # Comparisons with NaN, where nothing was measured, are False.
        if wp.abs(nearer) <= tolerance:
            confirmed += 1
        if nearer > tolerance:
            contradicted += 1
        if nearer < -tolerance:
            blind += 1
    said[i, 0] = confirmed
    said[i, 1] = contradicted
    said[i, 2] = blind


@wp.kernel
def agreement_kernel(
    first: int,
    points: wp.array[wp.vec3d],  # [n] in the world [m]
    eyes: wp.array[Eye],
    depth: wp.array[float],  # depth maps of all eyes [m], NaN: unknown
    voxel_size: wp.float64,  # [m]
    # output
    agreement: wp.array[float],  # [n] of the views that measured the surface near a point, 0..1
):
    """Compute the share of the views that agree; see `digs_warp.init.visibility.agreement_of_views`."""
    i = first + wp.tid()
    agreeing = int(0)
    near = int(0)
    for e in range(eyes.shape[0]):
        measured, own = depths_at(eyes[e], depth, points[i])
        apart = wp.abs(measured - own)
        # Comparisons with NaN, where nothing was measured, are False.
        if apart <= _AGREES * voxel_size:
            agreeing += 1
        if apart <= _NEAR * voxel_size:
            near += 1
    if near > 0:
        agreement[i] = float(agreeing) / float(near)
    else:
        agreement[i] = 1.0
