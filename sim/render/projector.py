"""The light of a dot projector on the scene, as one eye sees it: one Warp thread per pixel.

A dot on a white matte surface that faces the projector at distance 1 m has brightness 1 (`Projected`). Light
that surfaces pass on to others is left out: the projector's reflection in a mirror lights nothing.
"""

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import ray_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.sim.render.hit_material import Look, material_at_hit
from digs_warp.sim.render.lighting import luminance
from digs_warp.sim.render.surface import OPAQUE, Surface, is_blocked, passes_by, trace
from digs_warp.sim.render.surround import boundary_distance, boundary_normal
from digs_warp.sim.render.view import FAR, View, center_ray, make_view
from digs_warp.sim.render.views import Projected
from digs_warp.sim.scene.environment import Surround
from digs_warp.sim.scene.scene import DIELECTRIC_REFLECTANCE
from digs_warp.sim.sensor.infrared.pair import SPOT, DotPattern, dot_pattern

wp.set_module_options(ray_module_options())

# A ray from the projector ends this share of its length before the point that it lights.
SAME_POINT = wp.constant(1.0e-4)

# Share of infrared light that the surround reflects: a panorama shows its light, not what it is made of
# [tuned].
SURROUND_REFLECTANCE = wp.constant(0.5)

# Of the gloss on it, at normal incidence.
PLAIN_REFLECTANCE = wp.constant(DIELECTRIC_REFLECTANCE)

# Smoother surfaces reflect the projector into a point that hardly any pixel sees.
LEAST_ROUGHNESS = wp.constant(0.05)

# Square of the distance, in standard deviations, from which on a spot has less than 1e-5 of its top.
END = wp.constant(23.0)

PI = wp.constant(3.14159265)


@wp.struct
class DotGrid:
    """`DotPattern` for kernels."""

    dots: wp.array2d[wp.vec3]  # [rows, columns] x, y, brightness
    left: float
    top: float
    cell: float
    spot: float  # standard deviation of a spot on the plane of the pattern
    dimming: float  # of its peak, because a pixel collects light from an area


@wp.func
def spot_light(grid: DotGrid, x: float, y: float) -> float:
    """Brightness of the pattern at a place of its plane; 1: the center of a mean dot, unblurred."""
    column = int(wp.floor((x - grid.left) / grid.cell))
    row = int(wp.floor((y - grid.top) / grid.cell))
    light = wp.float32(0.0)
    for j in range(wp.max(row - 1, 0), wp.min(row + 2, grid.dots.shape[0])):
        for i in range(wp.max(column - 1, 0), wp.min(column + 2, grid.dots.shape[1])):
            dot = grid.dots[j, i]
            away = (x - dot[0]) * (x - dot[0]) + (y - dot[1]) * (y - dot[1])
            if away < END * grid.spot * grid.spot:
                light += dot[2] * wp.exp(-0.5 * away / (grid.spot * grid.spot))
    return grid.dimming * light


@wp.func
def reflectance(look: Look, to_light: wp.vec3, to_eye: wp.vec3) -> float:
    """Light toward the eye over that of a white matte surface that faces the light.

    The renderer's material: a matte base under a GGX coat (Walter et al. 2007, with Smith's shadowing).
    """
    light_cosine = wp.dot(look.normal, to_light)
    eye_cosine = wp.dot(look.normal, to_eye)
    if light_cosine <= 0.0 or eye_cosine <= 0.0:
        return 0.0
    half = wp.normalize(to_light + to_eye)
    half_cosine = wp.max(wp.dot(look.normal, half), 0.0)
    toward = wp.max(wp.dot(to_light, half), 0.0)
    f0 = wp.lerp(look.reflectance, luminance(look.color), look.metallic)
    # Powers by multiplication: wp.pow takes as long as the rays.
    aside2 = (1.0 - toward) * (1.0 - toward)
    fresnel = f0 + (1.0 - f0) * aside2 * aside2 * (1.0 - toward)
    roughness = wp.max(look.roughness, LEAST_ROUGHNESS)
    alpha2 = roughness * roughness * roughness * roughness
    spread = half_cosine * half_cosine * (alpha2 - 1.0) + 1.0
    normals = alpha2 / (PI * spread * spread)
    light_shadow = light_cosine + wp.sqrt(alpha2 + (1.0 - alpha2) * light_cosine * light_cosine)
    eye_shadow = eye_cosine + wp.sqrt(alpha2 + (1.0 - alpha2) * eye_cosine * eye_cosine)
    coat = PI * fresnel * normals / (light_shadow * eye_shadow)
    base = (1.0 - look.metallic) * (1.0 - fresnel) * luminance(look.color)
    return (base + coat) * light_cosine


@wp.kernel
def projector_kernel(
    first: int,
    view: View,
    surface: Surface,
    projector: wp.vec3,  # its center in the world
    projector_from_world: wp.mat33,
    grid: DotGrid,
    # outputs
    peak: wp.array[float],  # [pixels] light of a mean dot's center
    light: wp.array[float],  # [pixels] light of the pattern
):
    """Look through the center of a pixel at the first opaque surface, and from there to the projector."""
    pixel = first + wp.tid()
    direction = view.world_from_cam * center_ray(view, pixel)
    start = wp.float32(0.0)
    # With a reach of 0 the query ends at once.
    is_empty = passes_by(surface.radius, view.center, direction, 0.0)
    if surface.see_through == 1 and not is_empty:
        distance = trace(surface, view.center, direction, FAR, view.pixel_cone, OPAQUE)
        start = wp.where(distance < 0.0, FAR, distance * (1.0 - SAME_POINT))
    origin = view.center + start * direction
    hit = wp.mesh_query_ray(surface.mesh, origin, direction, wp.where(is_empty, 0.0, FAR))
    look = Look()
    away = start + hit.t
    if hit.result:
        look = material_at_hit(surface, hit, direction, away * view.pixel_cone)
    else:
        away = boundary_distance(view.boundary, view.center, direction)
        look.color = wp.vec3(SURROUND_REFLECTANCE)
        look.reflectance = PLAIN_REFLECTANCE
        look.roughness = 1.0
        look.normal = boundary_normal(view.boundary, view.center + away * direction)
        look.facet_normal = look.normal
    ray = view.center + away * direction - projector
    reach = wp.length(ray)
    ray = ray / reach
    seen = projector_from_world * ray
    bright = wp.float32(0.0)
    if seen[2] > 0.0 and wp.dot(look.facet_normal, ray) < 0.0:
        # Dots are a fixed distance apart on the plane, so they send 1 / cos^3 as much into a unit of angle.
        depth = reach * seen[2]
        bright = reflectance(look, -ray, -direction) / (depth * depth * seen[2])
    if bright > 0.0 and not passes_by(surface.radius, projector, ray, 0.0):
        if is_blocked(surface, projector, ray, reach * (1.0 - SAME_POINT)):
            bright = 0.0
    peak[pixel] = bright
    spots = wp.float32(0.0)
    if bright > 0.0:
        spots = spot_light(grid, seen[0] / seen[2], seen[1] / seen[2])
    light[pixel] = bright * spots


def project_dots(
    surface: Surface,
    camera: Camera,
    surround: Surround,
    world_from_projector: np.ndarray,
    threads: int = 0,
) -> Projected:
    """Return what a projector adds to the image of an eye.

    Args:
        surface: the scene; light passes through what is transparent.
        camera: the eye.
        surround: where the environment is.
        world_from_projector: its pose, (4, 4); it looks along z.
        threads: 0: all cores.
    """
    view = make_view(camera, surround)
    k = camera.intrinsics
    grid = _upload(dot_pattern(), 1.0 / min(k.fx, k.fy))
    count = k.height * k.width
    peak, light = (wp.empty(count, dtype=float, device="cpu") for _ in range(2))
    center = wp.vec3(*world_from_projector[:3, 3])
    axes = wp.mat33(world_from_projector[:3, :3].T.astype(np.float32))
    inputs = [view, surface, center, axes, grid, peak, light]
    launch_parallel(projector_kernel, count, inputs, threads=threads)
    return Projected(*(image.numpy().reshape(k.height, k.width) for image in (peak, light)))


def _upload(pattern: DotPattern, pixel: float) -> DotGrid:
    """Return the pattern for kernels; ``pixel`` is the side of a pixel on its plane.

    A pixel averages over its area: that is nearly a wider spot with the same light.
    """
    grid = DotGrid()
    grid.dots = wp.array(pattern.dots, dtype=wp.vec3, device="cpu")
    grid.left, grid.top, grid.cell = pattern.left, pattern.top, pattern.cell
    variance = SPOT**2 + pixel**2 / 12
    grid.spot = float(np.sqrt(variance))
    grid.dimming = SPOT**2 / variance
    return grid
