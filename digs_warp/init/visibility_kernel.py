"""Kernel of `digs_warp.init.visibility`: what each view says about each point. One thread per point.

In float64, so that it agrees with `digs_warp.camera.Camera.project` on the pixel that a point falls into.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

# Depths agree within this many voxels plus this share of the depth.
TOLERANCE_VOXELS = 2.0
TOLERANCE_SHARE = 0.01

_VOXELS = wp.constant(wp.float64(TOLERANCE_VOXELS))
_SHARE = wp.constant(wp.float64(TOLERANCE_SHARE))
_NOTHING = wp.constant(wp.float64(0.0))


@wp.struct
class Eye:
    """A camera and where its depth map begins.

    Attributes:
        cam_from_world: rigid transform.
        fx, fy, cx, cy: of the depth map [px].
        width, height: of the depth map [px].
        start: of the depth map in the array of all.
    """

    cam_from_world: wp.mat44d
    fx: wp.float64
    fy: wp.float64
    cx: wp.float64
    cy: wp.float64
    width: int
    height: int
    start: int


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
        eye = eyes[e]
        seen = wp.transform_point(eye.cam_from_world, points[i])
        u = eye.fx * seen[0] / seen[2] + eye.cx
        v = eye.fy * seen[1] / seen[2] + eye.cy
        inside = seen[2] > _NOTHING and u >= _NOTHING and v >= _NOTHING
        inside = inside and u < wp.float64(eye.width) and v < wp.float64(eye.height)
        if not inside:
            blind += 1
        else:
            place = eye.start + int(v) * eye.width + int(u)
            measured = wp.float64(depth[place])
            nearer = measured - seen[2]
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
