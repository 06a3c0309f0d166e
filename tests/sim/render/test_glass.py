"""Bodies of glass against formulas in double precision: they bend, tint and reflect light."""

from dataclasses import replace

import numpy as np
import trimesh

from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate, scene_of

UP = np.array([0.0, 0.0, 1.0])
INTRINSICS = Intrinsics.from_fov(160, 90, 40.0)
EYE = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
BLACK = Environment(np.zeros((16, 32, 3), np.float32))
IOR = 1.5
GLASS = Material(
    "glass",
    np.ones(3, np.float32),
    roughness=0.0,
    transmission=1.0,
    ior=IOR,
    absorption=(0.0, 0.0, 0.0),
)


def body(mesh: trimesh.Trimesh, material: Material, smooth: bool = False) -> Scene:
    """A closed mesh; its faces are flat unless ``smooth``."""
    if not smooth:
        mesh = mesh.copy()
        mesh.unmerge_vertices()
    return scene_of(mesh.vertices, mesh.faces, mesh.vertex_normals, material)


def glow(level: float) -> Material:
    return Material("glow", np.zeros(3, np.float32), metallic=1.0, emission=(level, level, level))


def linear(scene: Scene, environment: Environment, camera: Camera = EYE) -> np.ndarray:
    return linear_from_srgb(RaycastRenderer(scene, environment).render_image(camera, 16)[0] / 255)


def coat(cosine: np.ndarray, f0: float) -> np.ndarray:
    """Karis 2014 at roughness 0."""
    a004 = np.minimum(1.0, 2.0 ** (-9.28 * cosine)) + 0.0425
    return (1.04 - 1.04 * a004) * f0 + np.maximum(1.04 * a004 - 0.04, 0.0)


def refracted(d: np.ndarray, n: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Snell's law for rays (n, 3) against normals (n, 3); also the cosine behind the surface."""
    cosine = -(d * n).sum(axis=1, keepdims=True)
    behind = np.sqrt(1 - ratio**2 * (1 - cosine**2))
    return ratio * d + (ratio * cosine - behind) * n, behind


def through_sphere(origin: np.ndarray, d: np.ndarray, radius: float, ior: float) -> tuple:
    """What rays meet in a sphere around the origin: directions reflected, leaving, and their shares."""
    along = (d @ origin)[:, None]
    t = -along - np.sqrt(along**2 - origin @ origin + radius**2)
    n = (origin + t * d) / radius
    f = coat(-(d * n).sum(axis=1, keepdims=True), 0.04)
    mirrored = d - 2 * (d * n).sum(axis=1, keepdims=True) * n
    inside, cosine = refracted(d, n, 1 / ior)
    length = 2 * radius * cosine
    m = -(n + length / radius * inside)  # against the ray where it leaves
    inner = inside - 2 * (inside * m).sum(axis=1, keepdims=True) * m
    leaving, outside = refracted(inside, m, ior)
    return mirrored, f, inner, leaving, coat(outside, 0.04), length


def colored(directions: np.ndarray) -> np.ndarray:
    """The light of a direction."""
    return 0.5 + 0.45 * np.sin(5 * directions)


def test_a_sphere_of_glass_shows_the_surround_upside_down_where_snell_says() -> None:
    """In a surround whose color says the direction."""
    sky = Environment(colored(panorama_directions(512, 256)).astype(np.float32), radius=500.0)
    absorption = (2.0, 0.5, 5.0)
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.2)
    scene = body(ball, replace(GLASS, absorption=absorption), smooth=True)
    renderer = RaycastRenderer(scene, sky)
    image = linear_from_srgb(renderer.render_image(EYE, 16)[0] / 255)
    ways = EYE.unproject(pixel_centers(160, 90), np.ones((90, 160))) - EYE.center_world
    ways = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
    nearest = np.linalg.norm(np.cross(ways, EYE.center_world), axis=-1)
    inside = nearest < 0.8 * 0.2
    assert inside.sum() > 1000

    def expected(ior: float) -> np.ndarray:
        found = through_sphere(EYE.center_world, ways[inside], 0.2, ior)
        mirrored, f, inner, leaving, g, length = found
        kept = np.exp(-np.array(absorption) * length)
        behind = kept * (g * colored(inner) + (1 - g) * colored(leaving))
        return renderer.exposure * (f * colored(mirrored) + (1 - f) * behind)

    clear = (expected(IOR) < 0.98).all(axis=1)  # brighter is clipped
    error = (image[inside] - expected(IOR))[clear]
    assert clear.sum() > 500
    assert np.sqrt((error**2).mean()) < 0.004 and np.abs(error).max() < 0.02
    assert np.sqrt(((image[inside] - expected(1.4))[clear] ** 2).mean()) > 0.02


def test_a_slab_absorbs_by_its_thickness() -> None:
    absorption = (1.0, 5.0, 20.0)
    box = trimesh.creation.box(extents=(0.1, 0.8, 0.8))
    slab = body(box, replace(GLASS, absorption=absorption))
    lamp = plate((-0.4, 0, 0), (0, 0.6, 0), (0, 0, 0.6), glow(0.9))
    middle = linear(join_scenes(slab, lamp), BLACK)[45, 80]
    through = (1 - coat(np.ones(1), 0.04)) ** 2
    np.testing.assert_allclose(
        middle, 0.9 * through * np.exp(-0.1 * np.array(absorption)), atol=0.006
    )


def test_light_is_totally_reflected_in_a_prism() -> None:
    """The ray meets the long side at 45 degrees: it leaves through the other leg, toward +y."""
    corners = np.array([[0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    points = np.concatenate([np.c_[corners, np.full(3, z)] for z in (-0.3, 0.3)])
    prism = body(trimesh.convex.convex_hull(points), GLASS)
    lamp = plate((0, 0.5, 0), (0.4, 0, 0), (0, 0, 0.4), glow(0.9))
    middle = linear(join_scenes(prism, lamp), BLACK)[45, 80]
    np.testing.assert_allclose(middle, 0.9 * 0.96**2, atol=0.01)
    thin = body(trimesh.convex.convex_hull(points), replace(GLASS, absorption=None))
    assert linear(join_scenes(thin, lamp), BLACK)[45, 80].max() < 0.05
