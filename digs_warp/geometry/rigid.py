"""Rigid transforms and quaternions, in float64 NumPy; and boxes of pixels.

A transform is a (4, 4) matrix named ``b_from_a``: ``points_b = transform_points(b_from_a, points_a)``.
Quaternions are xyzw (as in Warp and in USD buffers); COLMAP and PLY use wxyz and convert at their door.
"""

import numpy as np

# Flips y and z of a camera's axes: OpenCV (x right, y down, z forward) <-> OpenGL (x right, y up, z back).
OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])

PixelBox = tuple[int, int, int, int]
"""Pixels x0 <= x < x1, y0 <= y < y1 as (x0, y0, x1, y1); empty when x0 >= x1 or y0 >= y1."""


def mask_box(mask: np.ndarray) -> PixelBox:
    """Return the box of the pixels above 0, (0, 0, 0, 0) when there is none."""
    ys, xs = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(xs):
        return 0, 0, 0, 0
    return int(xs[0]), int(ys[0]), int(xs[-1]) + 1, int(ys[-1]) + 1


def grown(mask: np.ndarray, radius: float) -> np.ndarray:
    """Return a mask grown by squares that reach at least ``radius`` [px] to all sides."""
    import cv2

    side = 2 * int(np.ceil(radius)) + 1
    return cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)).astype(bool)


def transform_points(b_from_a: np.ndarray, points_a: np.ndarray) -> np.ndarray:
    """Apply a (4, 4) transform to points, shape (..., 3)."""
    return points_a @ b_from_a[:3, :3].T + b_from_a[:3, 3]


def rigid(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Return the (4, 4) transform of a (3, 3) rotation and a (3,) translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def invert_rigid(b_from_a: np.ndarray) -> np.ndarray:
    """Return ``a_from_b`` of a rotation and translation (exact: no matrix inverse)."""
    rotation = b_from_a[:3, :3].T
    return rigid(rotation, -rotation @ b_from_a[:3, 3])


def laid_over(points: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """Return the rigid motion, (4, 4), that lays points (n, 3) over others (n, 3): least squares (Kabsch)."""
    middle, place = points.mean(axis=0), onto.mean(axis=0)
    u, _, vt = np.linalg.svd((onto - place).T @ (points - middle))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return rigid(rotation, place - rotation @ middle)


def is_rigid(matrix: np.ndarray, tolerance: float = 1e-5) -> bool:
    """Whether a (4, 4) matrix is finite, orthonormal, right-handed, with last row (0, 0, 0, 1)."""
    matrix = np.asarray(matrix, dtype=np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        return False
    rotation = matrix[:3, :3]
    orthonormal = np.abs(rotation @ rotation.T - np.eye(3)).max() < tolerance
    return bool(
        orthonormal and np.linalg.det(rotation) > 0 and np.allclose(matrix[3], (0, 0, 0, 1))
    )


# Float32 has seven digits: from here on [m], and if the scene is that much smaller, they are too few.
FAR, FAR_EXTENTS = 1000.0, 10.0


def far_offset(places: np.ndarray) -> np.ndarray | None:
    """Return whole metres, (3,), that bring places near the origin, shape (n, 3); None: they are near.

    Survey coordinates such as UTM are millions of metres.
    """
    middle = np.median(places, axis=0)
    # Of most: a lost camera may be in the origin.
    extent = 4 * float(np.median(np.linalg.norm(places - middle, axis=1)))
    return np.round(middle) if np.linalg.norm(middle) > max(FAR, FAR_EXTENTS * extent) else None


def look_at(eye: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return ``world_from_cam`` of a camera at ``eye`` that looks at ``target`` (OpenCV axes).

    Raises:
        ValueError: ``eye`` equals ``target``, or the line of sight is parallel to ``up``.
    """
    forward = np.asarray(target, dtype=np.float64) - eye
    distance = np.linalg.norm(forward)
    if distance == 0:
        raise ValueError("look_at: the eye and the target are the same point")
    forward = forward / distance
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 1e-9:
        raise ValueError("look_at: the line of sight is parallel to 'up'")
    right = right / np.linalg.norm(right)
    down = np.cross(forward, right)
    return rigid(np.stack([right, down, forward], axis=1), np.asarray(eye, dtype=np.float64))


def rotation_in_plane(angle: float) -> np.ndarray:
    """Return the rotation by an angle [rad] from x toward y, shape (2, 2): in space, about the z axis."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def matrix_from_quat_xyzw(quats: np.ndarray) -> np.ndarray:
    """Return rotation matrices, shape (..., 3, 3), of quaternions xyzw, shape (..., 4).

    Quaternions are normalized first; a zero quaternion gives the identity, as in the splat kernels.
    """
    quats = np.asarray(quats, dtype=np.float64)
    norm = np.linalg.norm(quats, axis=-1, keepdims=True)
    unit = np.where(norm > 0, quats / np.where(norm > 0, norm, 1.0), (0.0, 0.0, 0.0, 1.0))
    x, y, z, w = np.moveaxis(unit, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def turn_degrees(rotations: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the angles between rotations, (..., 3, 3) each [degree]; exact for small ones, too."""
    # The Frobenius norm of R - S is 2 sqrt(2) sin(angle / 2).
    chords = np.linalg.norm(rotations - others, axis=(-2, -1)) / np.sqrt(8.0)
    return np.degrees(2 * np.arcsin(np.minimum(chords, 1.0)))


def matrix_from_rotation_vector(vector: np.ndarray) -> np.ndarray:
    """Return the rotation matrix, shape (3, 3), of a rotation vector [rad], shape (3,)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(np.asarray(vector, dtype=np.float64)).as_matrix()


def quat_xyzw_from_matrix(rotations: np.ndarray) -> np.ndarray:
    """Return unit quaternions xyzw with w >= 0, shape (..., 4), of rotations, shape (..., 3, 3)."""
    from scipy.spatial.transform import Rotation

    rotations = np.asarray(rotations, dtype=np.float64)
    quats = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(canonical=True)
    return quats.reshape(*rotations.shape[:-2], 4)


def quat_multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the Hamilton product of quaternions xyzw, shapes (..., 4): rotate by b, then by a."""
    ax, ay, az, aw = np.moveaxis(np.asarray(a, dtype=np.float64), -1, 0)
    bx, by, bz, bw = np.moveaxis(np.asarray(b, dtype=np.float64), -1, 0)
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )
