"""The light of the environment's bright spots at a hit, with shadows: on the matte base and as highlights."""

import numpy as np
import warp as wp

from digs_warp.sim.render.key_lights import RIM_POINTS, SPOT_RADIUS_DEGREES, KeyLights
from digs_warp.sim.render.lighting import PI, TWO_PI, Light
from digs_warp.sim.render.look import Look, matte_color
from digs_warp.sim.render.shadows import Place, seen_share
from digs_warp.sim.render.surface import Surface

wp.set_module_options({"enable_backward": False})

# Spots that add less than this share of full white are not worth shadow rays.
FAINT_KEY = wp.constant(0.005)

# Largest angle between a point of a spot and the spot's direction [rad].
SPOT_RADIUS = wp.constant(float(2.0 * np.radians(SPOT_RADIUS_DEGREES)))

# Roughness of the lobes that weight the spots of a highlight.
SHARPEST_LOBE = wp.constant(0.2)
WIDEST_LOBE = wp.constant(0.98)


@wp.func
def lobe_at(cosine: float, alpha2: float) -> float:
    """GGX lobe around the reflected ray, at an angle from it, times that cosine (Karis 2013, n = v = r)."""
    half2 = 0.5 + 0.5 * cosine
    root = half2 * (alpha2 - 1.0) + 1.0
    return wp.max(cosine, 0.0) * alpha2 / (root * root)


@wp.func
def lobe_area(alpha2: float) -> float:
    """Integral of `lobe_at` over all directions; alpha2 below 1."""
    half = 0.5 * (alpha2 - 1.0)
    middle = 0.5 * (alpha2 + 1.0)
    return TWO_PI * alpha2 * (wp.log(alpha2 / middle) + middle / alpha2 - 1.0) / (half * half)


@wp.func
def highlight_of(
    keys: KeyLights, spot: int, mirrored: wp.vec3, alpha2: float, scale: float
) -> float:
    """Light of a spot in the lobe around the reflected ray; 0: too faint to count."""
    strength = scale * keys.strengths[spot]
    nearest = wp.min(wp.dot(mirrored, keys.vectors[spot]) + SPOT_RADIUS, 1.0)
    weight = wp.float32(0.0)
    if strength * lobe_at(nearest, alpha2) > FAINT_KEY:
        for p in range(RIM_POINTS):
            weight += lobe_at(wp.dot(mirrored, keys.rims[spot, p]), alpha2)
    return weight * strength


@wp.struct
class SpotLight:
    """What the bright spots give a hit."""

    diffuse: wp.vec3  # reflected by the matte base
    highlights: float  # share of the spots in the lobe around the reflected ray that the hit sees


@wp.func
def spot_light(
    surface: Surface, light: Light, look: Look, place: Place, mirrored: wp.vec3, reflected: float
) -> SpotLight:
    """Measure the light of the bright spots with shadows; ``reflected``: share of the lobe that is.

    Where a spot hardly matters, openness replaces its rays.
    """
    keys = light.keys
    albedo = matte_color(look)
    brightest = wp.max(albedo)
    alpha2 = wp.pow(wp.clamp(look.roughness, SHARPEST_LOBE, WIDEST_LOBE), 4.0)
    scale = PI * reflected / lobe_area(alpha2)
    is_kept = look.on_table == 1 and surface.table.is_soft == 1
    total = wp.float32(0.0)
    seen = wp.float32(0.0)
    diffuse = wp.vec3(0.0)
    for k in range(keys.count):
        incoming = wp.dot(look.normal, keys.vectors[k])
        highlight = highlight_of(keys, k, mirrored, alpha2, scale)
        total += highlight
        if incoming > 0.0 and (highlight > 0.0 or brightest > FAINT_KEY):
            matters = brightest * incoming * keys.strengths[k] >= FAINT_KEY
            share = look.openness
            if is_kept:
                share = look.spots_seen
            elif matters or highlight > 0.0:
                share = seen_share(surface, keys, k, place)
            seen += highlight * share
            diffuse += (share * incoming) * keys.colors[k]
    found = SpotLight()
    found.diffuse = wp.cw_mul(albedo, diffuse)
    found.highlights = wp.where(total > 0.0, seen / wp.max(total, 1.0e-9), 1.0)
    return found
