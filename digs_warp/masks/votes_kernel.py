"""Kernel of `digs_warp.masks.votes`: how other views vote on points. One thread per point."""

import warp as wp

from digs_warp.device.eyes import Eye, pixel_seen, place_of, shows
from digs_warp.geometry.reproject import SAME_SURFACE
from digs_warp.geometry.reproject_kernel import agrees

wp.set_module_options({"enable_backward": False})

# A view votes on a point if it measures it at the same depth, within this share.
_SAME_DEPTH = wp.constant(wp.float64(SAME_SURFACE.relative))


@wp.kernel
def votes_kernel(
    first: int,
    points: wp.array[wp.vec3d],  # [n] in the world [m]
    voters: wp.array[int],  # numbers of the eyes that vote
    eyes: wp.array[Eye],
    depth: wp.array[float],  # depth maps of all eyes [m], NaN: unknown
    masks: wp.array[wp.uint8],  # of all eyes, not 0 on the object
    # output
    votes: wp.array2d[
        int
    ],  # [n, 2] views that vote on a point, and those of them that call it object
):
    """Count the votes on a point."""
    i = first + wp.tid()
    found = int(0)
    for_object = int(0)
    for n in range(voters.shape[0]):
        eye = eyes[voters[n]]
        seen = pixel_seen(eye, points[i])
        if shows(eye, seen):
            place = place_of(eye, seen)
            # A comparison with NaN, where nothing was measured, is False.
            if agrees(seen[2], wp.float64(depth[place]), _SAME_DEPTH * seen[2]):
                found += 1
                if masks[place] != wp.uint8(0):
                    for_object += 1
    votes[i, 0] = found
    votes[i, 1] = for_object
