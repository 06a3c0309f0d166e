"""The planes that objects stand on, and their light: ambient occlusion by rays, and what open ground gets.

The ground's picture (a panorama's floor) already has the light of the place where it was taken. Objects take
some of it away: its share that still arrives is the openness for the smooth light, and a shadow ray for each
bright spot.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.data.images import linear_from_srgb
from digs_warp.device.kernel_options import ray_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.sim.render.environment_light import light_from_above
from digs_warp.sim.render.lighting import SPOT_POINTS, KeyLights, Light
from digs_warp.sim.render.surface import Surface, is_blocked
from digs_warp.sim.render.surround import LightGrid, LightMap, light_on
from digs_warp.sim.render.view import FAR
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene

wp.set_module_options(ray_module_options())

# Rays of each node, and nodes along the longer side of the fine and of the coarse grid.
RAYS = wp.constant(128)
FINE, COARSE = 144, 56

# The fine grid reaches this share of the objects' size beyond them; the coarse one this many of their heights
# and widths: a cube that far away covers less than a hundredth of the sky.
FINE_MARGIN = 0.2
COARSE_HEIGHTS, COARSE_WIDTHS = 1.5, 0.7

# Rays of each node to each bright spot.
SPOT_RAYS = wp.constant(16)

# Successive samples of a pixel look at points of a spot that are far apart: an odd step through all of them.
SPOT_STRIDE = wp.constant(23)

# Spots wider than this, root mean square around their middle, have penumbrae that the grids resolve. Single
# shadow rays would be noisy there, and wasted [degrees].
SOFT_DEGREES = 2.0

# Bright spots with less than this share of the light on the ground cast no shadow of their own.
FAINT_SHARE = wp.constant(0.02)

GOLDEN_ANGLE = wp.constant(2.399963229728653)
UP = wp.constant(wp.vec3(0.0, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane that things stand on.

    Attributes:
        height: z [m].
        low, high: corners of the plane, (2,) [m].
        things: corners of the box around what stands on it, (2, 3) [m].
        albedo: mean color, linear, (3,); None: unknown, part of the surround.
        material: number of its material; -1: part of the surround.
    """

    height: float
    low: np.ndarray
    high: np.ndarray
    things: np.ndarray
    albedo: np.ndarray | None = None
    material: int = -1


@wp.kernel
def _light_kernel(
    first: int,
    surface: Surface,
    keys: KeyLights,
    low: wp.vec2,
    step: wp.vec2,
    columns: int,
    height: float,
    # outputs
    values: wp.array[wp.vec2],  # [nodes]
):
    """Measure one node: rays to the sky by Malley's method, as in ambient_occlusion, and to the spots."""
    node = first + wp.tid()
    x = low[0] + float(node % columns) * step[0]
    y = low[1] + float(node // columns) * step[1]
    place = wp.vec3(x, y, height)
    free = wp.float32(0.0)
    for i in range(RAYS):
        radius2 = (float(i) + 0.5) / float(RAYS)
        radius = wp.sqrt(radius2)
        angle = float(i) * GOLDEN_ANGLE
        direction = wp.vec3(radius * wp.cos(angle), radius * wp.sin(angle), wp.sqrt(1.0 - radius2))
        if not is_blocked(surface, place, direction, FAR):
            free += 1.0
    total = wp.float32(0.0)
    seen = wp.float32(0.0)
    for k in range(keys.count):
        weight = keys.strengths[k] * wp.max(keys.vectors[k][2], 0.0)
        total += weight
        for j in range(SPOT_RAYS):
            toward = keys.points[k, j * keys.points.shape[1] // SPOT_RAYS]
            if weight > 0.0 and toward[2] > 0.0 and not is_blocked(surface, place, toward, FAR):
                seen += weight / float(SPOT_RAYS)
    visible = wp.where(total > 0.0, seen / wp.max(total, 1.0e-12), 1.0)
    values[node] = wp.vec2(free / float(RAYS), visible)


@wp.func
def arriving(plane: LightMap, openness: float, visible: float) -> wp.vec3:
    """Share of the open plane's light that arrives, per color channel."""
    total = plane.smooth + plane.keyed
    left = openness * plane.smooth + visible * plane.keyed
    return wp.vec3(
        wp.where(total[0] > 0.0, left[0] / wp.max(total[0], 1.0e-12), openness),
        wp.where(total[1] > 0.0, left[1] / wp.max(total[1], 1.0e-12), openness),
        wp.where(total[2] > 0.0, left[2] / wp.max(total[2], 1.0e-12), openness),
    )


@wp.func
def spots_matter(plane: LightMap) -> bool:
    """Whether the bright spots cast shadows of their own on the plane."""
    return wp.max(plane.keyed) > FAINT_SHARE * wp.max(plane.smooth + plane.keyed)


@wp.func
def seen_spots(surface: Surface, keys: KeyLights, point: wp.vec3, number: int) -> float:
    """Share of the bright spots that is seen from a point of the floor: a ray to one point of each.

    ``number`` says which: that of the sample in its pixel.
    """
    origin = point + surface.lift * UP
    total = wp.float32(0.0)
    seen = wp.float32(0.0)
    for k in range(keys.count):
        weight = keys.strengths[k] * wp.max(keys.vectors[k][2], 0.0)
        if weight > 0.0:
            total += weight
            toward = keys.points[k, (number * SPOT_STRIDE) % SPOT_POINTS]
            if not is_blocked(surface, origin, toward, FAR):
                seen += weight
    return seen / total


@wp.func
def has_sharp_shadows(plane: LightMap) -> bool:
    """Whether the grids cannot hold the shadows on the plane: every sample of a pixel asks the spots."""
    return plane.exists == 1 and plane.is_soft == 0 and spots_matter(plane)


@wp.func
def soft_floor_share(floor: LightMap, x: float, y: float) -> wp.vec3:
    """Share of the open floor's light that arrives at a place of it, where no shadow is sharp."""
    found = light_on(floor, x, y)
    return arriving(floor, found[0], wp.where(spots_matter(floor), found[1], found[0]))


@wp.func
def sharp_floor_share(surface: Surface, light: Light, point: wp.vec3, number: int) -> wp.vec3:
    """The same where shadows are sharp; ``number`` of the sample in its pixel."""
    openness = light_on(surface.floor, point[0], point[1])[0]
    return arriving(surface.floor, openness, seen_spots(surface, light.keys, point, number))


@wp.func
def may_be_shaded(surface: Surface, light: Light, point: wp.vec3, margin: float) -> bool:
    """Whether the objects may take light from a floor with sharp shadows within ``margin`` [m] of a point."""
    grid = surface.floor.coarse
    if (
        point[0] > grid.low[0] - margin
        and point[1] > grid.low[1] - margin
        and point[0] < grid.low[0] + grid.size[0] + margin
        and point[1] < grid.low[1] + grid.size[1] + margin
    ):
        return True
    for k in range(light.keys.count):
        # Within 18 degrees of the middle of a spot: see SPOT_RADIUS_DEGREES.
        toward = light.keys.vectors[k]
        along = -wp.dot(point, toward)
        nearest = wp.length(point + along * toward)
        if toward[2] > 0.0 and along > 0.0 and nearest < surface.radius + margin + 0.33 * along:
            return True
    return False


def measure_plane(surface: Surface, light: Light, plane: Plane, threads: int = 0) -> LightMap:
    """Return the light on a plane; ``surface`` holds what stands on it."""
    found = LightMap()
    found.exists = 1
    found.height = plane.height
    found.low, found.high = wp.vec2(*plane.low), wp.vec2(*plane.high)
    low, high = plane.things[:, :2].astype(np.float64)
    size = high - low
    tall = float(plane.things[1, 2] - plane.height)
    near = FINE_MARGIN * max(size.max(), tall)
    far = COARSE_HEIGHTS * tall + COARSE_WIDTHS * size.max()
    height = plane.height + surface.lift
    found.is_soft = int(_spread_degrees(light.keys) > SOFT_DEGREES)
    # Sharp spots get rays for every pixel.
    keys = light.keys if found.is_soft else KeyLights()
    found.fine = _measure_grid(surface, keys, low - near, high + near, FINE, height, threads)
    found.coarse = _measure_grid(surface, keys, low - far, high + far, COARSE, height, threads)
    smooth, keyed = light_from_above(light.irradiance.numpy(), light.keys)
    found.smooth, found.keyed = wp.vec3(*smooth), wp.vec3(*keyed)
    if plane.albedo is not None:
        found.glow = wp.vec3(*(plane.albedo * (smooth + keyed)))
    found.material = plane.material
    return found


def _spread_degrees(keys: KeyLights) -> float:
    """Return how wide the spots that light a plane from above are, root mean square; 0: there are none."""
    if not keys.count:
        return 0.0
    vectors, points = keys.vectors.numpy(), keys.points.numpy()
    weights = keys.strengths.numpy() * np.maximum(vectors[:, 2], 0.0)
    if not weights.any():
        return 0.0
    cosines = np.clip((points * vectors[:, None]).sum(axis=-1), -1.0, 1.0)
    squares = (np.arccos(cosines) ** 2).mean(axis=1)
    return float(np.rad2deg(np.sqrt(np.average(squares, weights=weights))))


def _measure_grid(
    surface: Surface,
    keys: KeyLights,
    low: np.ndarray,
    high: np.ndarray,
    nodes: int,
    height: float,
    threads: int,
) -> LightGrid:
    """Return the light between two corners, (2,) each, on ``nodes`` along the longer side."""
    size = high - low
    columns, rows = np.maximum(np.rint(nodes * size / size.max()), 8).astype(int).tolist()
    step = size / [columns - 1, rows - 1]
    values = wp.empty(rows * columns, dtype=wp.vec2, device="cpu")
    inputs = [surface, keys, wp.vec2(*low), wp.vec2(*step), columns, height, values]
    launch_parallel(_light_kernel, rows * columns, inputs, threads=threads)
    grid = LightGrid()
    grid.values = values.reshape((rows, columns))
    grid.low, grid.size = wp.vec2(*low), wp.vec2(*size)
    return grid


# A floor has no end within its surround [m].
ENDLESS = 1e5

# Level faces of the furniture (cosine), this near to the lowest point of the objects [m], carry them.
LEVEL, CONTACT = 0.999, 0.002


def planes_of(scene: Scene, environment: Environment) -> tuple[Plane | None, Plane | None]:
    """Return what things stand on in a scene: the top of a table, and the floor of the surround."""
    floor = None
    if environment.floor is not None:
        ends = np.full(2, ENDLESS)
        floor = Plane(environment.floor, -ends, ends, _box(scene.vertices))
    return _table_top(scene), floor


def _table_top(scene: Scene) -> Plane | None:
    """Return the level face of the furniture that the objects stand on."""
    if not scene.has_furniture:
        return None
    corners = scene.vertices[scene.faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = across[:, 2] > LEVEL * np.linalg.norm(across, axis=1)
    objects = _box(scene.object_vertices)
    near = np.abs(corners[..., 2] - objects[0, 2]).max(axis=1) < CONTACT
    top = (scene.face_objects == FURNITURE) & level & near
    if not top.any():
        return None
    low, high = _box(corners[top].reshape(-1, 3))
    number = int(scene.face_materials[top][0])
    albedo = _albedo(scene.materials[number])
    # Furniture may stand on the table, too.
    others = scene.vertices[np.unique(scene.faces[scene.face_materials != number])]
    things = _box(others[others[:, 2] > high[2] - CONTACT])
    return Plane(float(high[2]), low[:2], high[:2], things, albedo, number)


def _albedo(material: Material) -> np.ndarray:
    """Return the mean color of a material, linear, (3,)."""
    if material.texture is None:
        return material.base_color
    # By a table, as for panoramas: textures are large.
    linear = linear_from_srgb(np.arange(256) / 255.0)
    return material.base_color * linear[material.texture].mean(axis=(0, 1))


def _box(points: np.ndarray) -> np.ndarray:
    """Return the lowest and highest coordinates, (2, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float64)
