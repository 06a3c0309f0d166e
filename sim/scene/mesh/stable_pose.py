"""In which pose an object rests on the ground.

The pose of its file is kept if the object rests in it: its lowest points carry its center of mass with some
margin. Otherwise it is set onto the face of its hull that is nearest to that pose; or, if it would fall, onto
a probable one: `trimesh.poses` gives the chance of each when an object is dropped at random (Goldberg et al.,
"Part pose statistics", 1999).
"""

import warnings
from dataclasses import replace

import numpy as np

from digs_warp.geometry.rigid import matrix_from_rotation_vector
from digs_warp.sim.scene.mesh.resting import LIES_BELOW, Hull, hull_of, reaching_out, tips_over_at

# Points touch the ground if they are this near it: metres, and a share of the longest side.
CONTACT, CONTACT_SHARE = 5e-4, 2e-3

# A pose this near that of the file is taken for it: uneven bases, legs of different lengths [degrees].
SAME_POSE = 5.0

# A pose is probable if it has this share of the chance of the most probable one.
PROBABLE_SHARE = 0.5

SMALLEST_TURN = 1e-9  # [rad]

# The time to find all poses grows with the faces of the hull; round things have the most, and stay round with
# fewer.
MOST_FACES = 5_000
DIRECTIONS = 16  # of `reaching_out`: at most 3,000 faces

UP = np.array([0.0, 0.0, 1.0])


def resting_turn(vertices: np.ndarray) -> np.ndarray:
    """Return the rotation after which an object rests, shape (3, 3); the identity if it rests already.

    Args:
        vertices: of its faces, in the pose it would have in the world, z up [m], shape (n, 3), finite.
    """
    hull = hull_of(vertices)
    if hull is None or _rests(hull, UP):  # a flat sheet has no stable pose
        return np.eye(3)
    return _turn_to_z(_up_of_rest(hull))


def contact_points(vertices: np.ndarray, up: np.ndarray = UP) -> np.ndarray:
    """Return the vertices that touch the ground below them, shape (k, 3)."""
    near = min(CONTACT, CONTACT_SHARE * float(np.ptp(vertices, axis=0).max()))
    heights = vertices @ up
    return vertices[heights <= heights.min() + near]


def _rests(hull: Hull, up: np.ndarray) -> bool:
    return tips_over_at(hull, up, contact_points(hull.corners.reshape(-1, 3), up)) >= LIES_BELOW


def _up_of_rest(hull: Hull) -> np.ndarray:
    """Return which direction is up in the pose that the object takes, shape (3,)."""
    ups, chances = stable_ups(hull)
    if not len(ups):
        return UP
    nearest_first = np.argsort(-(ups @ UP), kind="stable")
    for up in ups[nearest_first]:
        if up @ UP < np.cos(np.deg2rad(SAME_POSE)):
            break
        if _rests(hull, up):
            return up
    probable = [i for i in nearest_first if chances[i] >= PROBABLE_SHARE * chances.max()]
    return ups[probable[0]]


def stable_ups(hull: Hull) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions that may be up at rest, (n, 3), and the chance of each, (n,), the best first."""
    import trimesh

    if len(hull.corners) > MOST_FACES:
        coarse = hull_of(reaching_out(hull.corners.reshape(-1, 3), DIRECTIONS))
        hull = hull if coarse is None else replace(coarse, center=hull.center)
    corners, faces = np.unique(hull.corners.reshape(-1, 3), axis=0, return_inverse=True)
    solid = trimesh.Trimesh(corners, faces.reshape(-1, 3), process=False)
    solid.fix_normals()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # slivers have no chance: NaN
        transforms, chances = trimesh.poses.compute_stable_poses(solid, center_mass=hull.center)
    chances = np.nan_to_num(chances)
    return transforms[:, 2, :3], chances


def _turn_to_z(up: np.ndarray) -> np.ndarray:
    """Return the smallest rotation that takes a unit vector to z, shape (3, 3)."""
    axis = np.cross(up, UP)
    length = float(np.linalg.norm(axis))
    if length < SMALLEST_TURN:
        return np.diag([1.0, 1.0, 1.0] if up[2] > 0 else [1.0, -1.0, -1.0])
    return matrix_from_rotation_vector(axis * (np.arctan2(length, up[2]) / length))
