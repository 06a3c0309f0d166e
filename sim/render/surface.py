"""The scene's triangles and materials on the device, and their values at a ray's hit."""

import warp as wp

from digs_warp.sim.render.surround import LightMap
from digs_warp.sim.render.textures import LINEAR, TextureSet, sample_texture
from digs_warp.sim.scene.scene import OPAQUE_SHARE

# Limits the stretch of a ray cone at grazing angles.
MIN_COSINE = wp.constant(0.1)

# Smallest opacity that stops `trace`.
ANY_SURFACE = wp.constant(0.0)
OPAQUE = wp.constant(OPAQUE_SHARE)

# The sphere around the scene grows by this share, more than the error of float32.
SPHERE_MARGIN = wp.constant(1.0e-4)

# Largest number of walls that a ray passes; a bottle of water has eight.
MAX_LAYERS = wp.constant(16)


@wp.struct
class MaterialData:
    """`digs_warp.sim.scene.scene.Material` for kernels; a texture of -1 is none."""

    see_through: int  # 0: opaque everywhere
    base_color: wp.vec3
    emission: wp.vec3
    roughness: float
    metallic: float
    opacity: float
    alpha_cutoff: float
    transmission: float
    reflectance: float  # of a dielectric, at normal incidence
    texture: int
    finish_texture: int
    opacity_texture: int
    transmission_texture: int
    emission_texture: int
    normal_texture: int


@wp.struct
class Surface:
    """Triangles and materials; arrays in the order of `digs_warp.sim.scene.scene.Scene`."""

    mesh: wp.uint64  # wp.Mesh
    points: wp.array[wp.vec3]  # [n]
    corners: wp.array[int]  # [3 m] vertex of each corner
    normals: wp.array[wp.vec3]  # [n]
    tangents: wp.array[wp.vec3]  # [n] along u; length 0: no direction; empty without normal maps
    handedness: wp.array[float]  # [m] 1, or -1 where the texture is mirrored; empty as above
    uvs: wp.array[wp.vec2]  # [n]
    colors: wp.array[wp.vec3]  # [n]
    openness: wp.array[wp.vec2]  # [nodes] unoccluded share in front of and behind the normal
    edges: wp.array[int]  # [3 m] node of each edge; see sim.render.ambient_occlusion
    shadows: wp.array[wp.uint64]  # kept shares of the spots; see sim.render.shadows
    vertex_shadows: wp.array2d[wp.uint8]  # [2 n, spots] those at the vertices
    edge_sizes: wp.array[float]  # [m] length of an edge [m]
    homes: wp.array[int]  # [n] 3 x largest face around a vertex + its corner there
    materials: wp.array[int]  # [m]
    objects: wp.array[int]  # [m] 0: furniture
    uv_levels: wp.array[float]  # [m] log2(texture widths per metre)
    data: wp.array[MaterialData]  # [materials]
    textures: TextureSet
    see_through: int  # 1: some material transmits or has an opacity below 1
    step: float  # [m] rays continue this far behind a surface that they pass
    lift: float  # [m] rays that leave a surface start this far off it
    radius: float  # [m] sphere around the origin that holds every point
    table: LightMap  # the top of a table
    floor: LightMap  # the floor of the surround


@wp.func
def between_corners(
    surface: Surface, values: wp.array[wp.vec3], face: int, u: float, v: float
) -> wp.vec3:
    """Value at a place of a triangle, linear between those of its vertices."""
    corner = 3 * face
    return (
        u * values[surface.corners[corner]]
        + v * values[surface.corners[corner + 1]]
        + (1.0 - u - v) * values[surface.corners[corner + 2]]
    )


@wp.func
def vertex_normal(surface: Surface, hit: wp.MeshQueryRay) -> wp.vec3:
    """Unit normal interpolated between the corners; may point to either side."""
    normal = between_corners(surface, surface.normals, hit.face, hit.u, hit.v)
    length = wp.length(normal)
    # Opposite vertex normals may cancel out; the triangle's own is always there.
    return wp.where(length > 1.0e-6, normal / wp.max(length, 1.0e-6), hit.normal)


@wp.func
def viewer_side(hit: wp.MeshQueryRay, direction: wp.vec3, normal: wp.vec3) -> float:
    """1 if ``normal`` points to the viewer's side of the triangle, else -1.

    Surfaces have two sides, and the windings of some meshes disagree with their normals.
    """
    return wp.where(wp.dot(hit.normal, direction) * wp.dot(hit.normal, normal) > 0.0, -1.0, 1.0)


@wp.func
def viewer_side_normal(surface: Surface, hit: wp.MeshQueryRay, direction: wp.vec3) -> wp.vec3:
    """Interpolated unit normal, turned toward the viewer."""
    normal = vertex_normal(surface, hit)
    return viewer_side(hit, direction, normal) * normal


@wp.func
def texture_position(surface: Surface, hit: wp.MeshQueryRay) -> wp.vec2:
    """Texture coordinates of the hit."""
    corner = 3 * hit.face
    w = 1.0 - hit.u - hit.v
    return (
        hit.u * surface.uvs[surface.corners[corner]]
        + hit.v * surface.uvs[surface.corners[corner + 1]]
        + w * surface.uvs[surface.corners[corner + 2]]
    )


@wp.func
def texture_level(
    surface: Surface, hit: wp.MeshQueryRay, direction: wp.vec3, cone_width: float
) -> float:
    """log2 of the share of a texture's width that the ray's cone covers; see `sample_texture`."""
    cosine = wp.max(wp.abs(wp.dot(hit.normal, direction)), MIN_COSINE)
    return surface.uv_levels[hit.face] + wp.log2(wp.max(cone_width, 1.0e-12) / cosine)


@wp.func
def is_see_through(surface: Surface, hit: wp.MeshQueryRay) -> bool:
    """Whether the hit may let light through; fast for opaque materials."""
    return surface.see_through == 1 and surface.data[surface.materials[hit.face]].see_through == 1


@wp.func
def opacity_at(surface: Surface, hit: wp.MeshQueryRay, level: float) -> float:
    """Opacity of the hit, 0 where the material is cut out."""
    data = surface.data[surface.materials[hit.face]]
    opacity = data.opacity
    if data.opacity_texture >= 0:
        uv = texture_position(surface, hit)
        opacity = sample_texture(surface.textures, data.opacity_texture, uv, level, LINEAR)[0]
    return wp.where(opacity < data.alpha_cutoff, 0.0, opacity)


@wp.func
def transmission_at(surface: Surface, hit: wp.MeshQueryRay, level: float) -> float:
    """Share of the light that passes through the body of the surface at the hit."""
    data = surface.data[surface.materials[hit.face]]
    transmission = data.transmission
    if data.transmission_texture >= 0:
        uv = texture_position(surface, hit)
        transmission = sample_texture(
            surface.textures, data.transmission_texture, uv, level, LINEAR
        )[0]
    return transmission


@wp.func
def trace(
    surface: Surface, origin: wp.vec3, direction: wp.vec3, reach: float, cone: float, least: float
) -> float:
    """Distance along the ray to the first surface that hides at least ``least``; -1: none in reach.

    Rays pass the holes of an opacity texture for any ``least``. ``cone`` is the spread of the ray [rad] for
    texture look-ups.
    """
    start = wp.float32(0.0)
    found = wp.float32(-1.0)
    for _layer in range(MAX_LAYERS):
        hit = wp.mesh_query_ray(surface.mesh, origin + start * direction, direction, reach - start)
        if not hit.result:
            break
        distance = start + hit.t
        if not is_see_through(surface, hit):
            found = distance
            break
        level = texture_level(surface, hit, direction, distance * cone)
        opacity = opacity_at(surface, hit, level)
        covered = opacity
        if least > 0.0:
            covered = opacity * (1.0 - transmission_at(surface, hit, level))
        if opacity > 0.0 and covered >= least:
            found = distance
            break
        start = distance + surface.step
        if start >= reach:
            break
    return found


@wp.func
def passes_by(radius: float, origin: wp.vec3, direction: wp.vec3, spread: float) -> bool:
    """Whether no ray within ``spread`` [rad] of a unit direction meets the sphere around the scene.

    Rays from inside the sphere do not pass by.
    """
    along = wp.dot(origin, direction)
    nearest = wp.length(origin - along * direction)
    grown = radius * (1.0 + SPHERE_MARGIN)
    # cos x >= 1 - x^2 / 2, sin x <= x: a turn by the spread brings the ray no nearer than this.
    clear = (1.0 - 0.5 * spread * spread) * nearest > grown + spread * wp.abs(along)
    return clear and wp.length(origin) > grown


@wp.func
def is_blocked(surface: Surface, origin: wp.vec3, direction: wp.vec3, reach: float) -> bool:
    """Whether something opaque lies within ``reach`` [m], at the finest texture level."""
    blocked = wp.mesh_query_ray_anyhit(surface.mesh, origin, direction, reach)
    if blocked and surface.see_through == 1:
        blocked = trace(surface, origin, direction, reach, 0.0, OPAQUE) >= 0.0
    return blocked


@wp.func
def beside_tangent_plane(
    surface: Surface, corner: int, point: wp.vec3, facet_normal: wp.vec3
) -> wp.vec3:
    """Vector from a point below the tangent plane of a corner up to that plane."""
    number = surface.corners[corner]
    normal = surface.normals[number]
    normal = wp.where(wp.dot(normal, facet_normal) < 0.0, -normal, normal)
    below = wp.min(wp.dot(point - surface.points[number], normal), 0.0)
    return -below * normal


@wp.func
def smooth_position_at(
    surface: Surface, face: int, facet_normal: wp.vec3, u: float, v: float
) -> wp.vec3:
    """A place of a triangle, lifted to the smooth surface that the vertex normals suggest.

    Shadow rays that start on the flat triangle would cut smooth shading into steps (Hanika, "Hacking the
    Shadow Terminator", Ray Tracing Gems II, 2021, chapter 4).
    """
    corner = 3 * face
    w = 1.0 - u - v
    point = between_corners(surface, surface.points, face, u, v)
    return (
        point
        + u * beside_tangent_plane(surface, corner, point, facet_normal)
        + v * beside_tangent_plane(surface, corner + 1, point, facet_normal)
        + w * beside_tangent_plane(surface, corner + 2, point, facet_normal)
    )
