"""Distance of reconstructed points to the true surface, and how much of it they, or cameras, cover."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np
import warp as wp

from digs_warp.checks import DigsError, check_positive, check_shape
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.words import counted

# Kernels are typed by Warp, whose stubs pyright cannot follow:
# pyright: reportAttributeAccessIssue=false, reportOperatorIssue=false, reportInvalidTypeForm=false
# pyright: reportArgumentType=false


# The surface hides a place from this share of the distance on: the place itself is on the surface, too.
BEFORE = wp.constant(0.999)
# A surface at less than 10 degrees to the line of sight is hardly a pixel wide: this is the sine.
EDGE_ON = 0.17


def visible_places(
    places_world: np.ndarray,
    normals_world: np.ndarray,
    surface: TriangleMesh,
    cameras: Sequence[Camera],
) -> np.ndarray:
    """Return which places at least one camera sees, shape (n,), bool.

    Args:
        places_world: on the surface [m], shape (n, 3).
        normals_world: of the surface there, to either side, shape (n, 3).
        surface: what can hide them; both sides of its triangles do.
        cameras: where they are looked at from.
    """
    visible = np.zeros(len(places_world), dtype=bool)
    mesh = _mesh_of(surface)
    for camera in cameras:
        left = np.flatnonzero(~visible)
        inside = camera.shows(*camera.project(places_world[left]))
        toward = places_world[left] - camera.center_world
        across = np.abs(np.einsum("ij,ij->i", toward, normals_world[left]))
        faced = across >= EDGE_ON * np.linalg.norm(toward, axis=1)
        asked = left[inside & faced]
        if not len(asked):
            continue
        places = np.ascontiguousarray(places_world[asked], dtype=np.float32)
        clear = wp.zeros(len(asked), dtype=wp.bool, device="cpu")
        center = wp.vec3(*camera.center_world.tolist())
        inputs = [mesh.id, center, wp.array(places, dtype=wp.vec3, device="cpu"), clear]
        launch_parallel(_clear_kernel, len(asked), inputs)
        visible[asked] = clear.numpy()
    return visible


@lru_cache(1)
def _mesh_of(surface: TriangleMesh) -> wp.Mesh:
    """Return a mesh to cast rays at; both questions about a surface take the same one."""
    return wp.Mesh(
        points=wp.array(np.ascontiguousarray(surface.points_world), dtype=wp.vec3, device="cpu"),
        indices=wp.array(surface.triangles.ravel(), dtype=int, device="cpu"),
    )


@wp.kernel(enable_backward=False)
def _clear_kernel(
    first: int,
    mesh: wp.uint64,
    center: wp.vec3,
    places: wp.array(dtype=wp.vec3),
    clear: wp.array(dtype=wp.bool),
):
    """Say whether nothing lies between the center and a place."""
    i = first + wp.tid()
    toward = places[i] - center
    reach = BEFORE * wp.length(toward)
    clear[i] = not wp.mesh_query_ray_anyhit(mesh, center, wp.normalize(toward), reach)


# Samples of the true surface for the distance from surface to points. The standard error of a mean over them
# is below 1 % of the spread.
DEFAULT_SAMPLES = 20_000


@dataclass(frozen=True)
class SurfaceScore:
    """Distances between points and a surface [m].

    Attributes:
        accuracy: mean distance from the points to the surface.
        completeness: mean distance from the surface to the nearest point.
        chamfer: mean of accuracy and completeness.
        recall: share of the surface within ``threshold`` of a point.
        f_score: harmonic mean of precision, the share of points within it of the surface, and recall.
        threshold: the distance [m] for these.
    """

    accuracy: float
    completeness: float
    chamfer: float
    recall: float
    f_score: float
    threshold: float

    def to_json(self) -> dict[str, float]:
        """Return the numbers by name."""
        return asdict(self)


def surface_score(
    points_world: np.ndarray,
    surface: TriangleMesh,
    threshold: float,
    samples: int = DEFAULT_SAMPLES,
    seed: int = 0,
) -> SurfaceScore:
    """Compare points with a true surface.

    Distances to the surface are exact (point to triangle). For distances from the surface, it is sampled
    uniformly by area; parts that no camera saw count as missing.

    Args:
        points_world: reconstructed points [m], shape (n, 3), n >= 1.
        surface: the true mesh, in the same world.
        threshold: distance [m] for precision, recall and F-score.
        samples: number of points on the surface.
        seed: seed of the samples.

    Raises:
        DigsError: no points, no surface, or a threshold that is not positive.
    """
    from scipy.spatial import cKDTree

    points = check_shape("points", np.asarray(points_world, np.float32), (None, 3))
    check_positive("threshold", threshold)
    if len(points) == 0 or len(surface) == 0:
        raise DigsError(
            f"surface score: {counted(len(points), 'point')} and {counted(len(surface), 'triangle')}, "
            "expected at least one each"
        )
    to_surface = distances_to_surface(points, surface)
    places = sample_surface(surface, samples, seed)
    to_points, _ = cKDTree(points).query(places, workers=-1)
    precision = float((to_surface <= threshold).mean())
    recall = float((to_points <= threshold).mean())
    total = precision + recall
    accuracy, completeness = float(to_surface.mean()), float(to_points.mean())
    return SurfaceScore(
        accuracy=accuracy,
        completeness=completeness,
        chamfer=0.5 * (accuracy + completeness),
        recall=recall,
        f_score=2 * precision * recall / total if total > 0 else 0.0,
        threshold=threshold,
    )


def sample_surface(surface: TriangleMesh, count: int, seed: int = 0) -> np.ndarray:
    """Return points sampled uniformly by area from the triangles [m], shape (count, 3), float64."""
    places, _ = sample_with_normals(surface, count, seed)
    return places


def sample_with_normals(
    surface: TriangleMesh, count: int, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of `sample_surface`, and the unit normals of their triangles, (count, 3) each."""
    random = np.random.default_rng(seed)
    corners = surface.points_world[surface.triangles].astype(np.float64)
    edges = corners[:, 1:] - corners[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.linalg.norm(normals, axis=1)
    if not areas.sum() > 0:
        raise DigsError("surface: its triangles have no area; expected a surface, not a line")
    chosen = random.choice(len(areas), size=count, p=areas / areas.sum())
    # The square root makes the density uniform over a triangle.
    root, along = np.sqrt(random.random(count)), random.random(count)
    first, second = root * (1 - along), root * along
    places = (
        corners[chosen, 0] + first[:, None] * edges[chosen, 0] + second[:, None] * edges[chosen, 1]
    )
    return places, normals[chosen] / areas[chosen, None]


def distances_to_surface(points_world: np.ndarray, surface: TriangleMesh) -> np.ndarray:
    """Return the distance [m] from each point, shape (n, 3), to the nearest triangle, shape (n,)."""
    mesh = _mesh_of(surface)
    points = np.ascontiguousarray(points_world, dtype=np.float32)
    # A query needs a bound; no distance exceeds the diagonal of the box around both.
    limit = float(np.linalg.norm(np.ptp(np.vstack([points, surface.points_world]), axis=0))) + 1.0
    distances = wp.zeros(len(points), dtype=float, device="cpu")
    inputs = [mesh.id, wp.array(points, dtype=wp.vec3, device="cpu"), limit, distances]
    launch_parallel(_distance_kernel, len(points), inputs)
    return distances.numpy()


@wp.kernel(enable_backward=False)
def _distance_kernel(
    first: int,
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    limit: float,
    distances: wp.array(dtype=float),
):
    i = first + wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, points[i], limit)
    nearest = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
    distances[i] = wp.length(points[i] - nearest)
