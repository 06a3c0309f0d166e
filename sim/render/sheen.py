"""The sheen of cloth: light that fibers scatter, mostly toward grazing views.

The share of even light that it adds is integrated once for each material, with the "Charlie" distribution
(Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF", 2017) of glTF's KHR_materials_sheen and the
visibility of Neubelt and Pettineo ("Crafting a Next-Gen Material Pipeline for The Order: 1886", 2013).
"""

import numpy as np
import warp as wp

from digs_warp.sim.render.surface import Surface

wp.set_module_options({"enable_backward": False})

# Cosines to the viewer at which the share is known: (0 ... STEPS)^2 / STEPS^2, denser at grazing views.
STEPS = wp.constant(32)

# Steps of the integral along the cosine to the light and around the normal.
FINE = 256

# Smoother fibers have a sheen narrower than a pixel; it is nearly a mirror at grazing views.
LEAST_ROUGHNESS = 0.07


def sheen_shares(roughness: float) -> np.ndarray:
    """Return the share of even light that a white sheen adds, at each cosine, (STEPS + 1,), float32, 0 to 1.

    Args:
        roughness: perceptual, 0 to 1.
    """
    alpha = max(roughness, LEAST_ROUGHNESS) ** 2
    light = (np.arange(FINE) + 0.5)[:, None] / FINE
    azimuth = (np.arange(FINE) + 0.5) / FINE * np.pi
    ring = np.sqrt(1 - light**2)
    shares = []
    for viewer in np.linspace(0.0, 1.0, STEPS + 1) ** 2:
        slant = np.sqrt(1 - viewer**2)
        half = np.stack(
            np.broadcast_arrays(
                ring * np.cos(azimuth) + slant, ring * np.sin(azimuth), light + viewer
            )
        )
        sine2 = 1 - half[2] ** 2 / (half**2).sum(axis=0)
        density = (2 + 1 / alpha) * np.maximum(sine2, 1e-12) ** (0.5 / alpha) / (2 * np.pi)
        visible = 1 / (4 * (light + viewer - light * viewer))
        shares.append(2 * np.pi * (density * visible * light).mean())
    return np.clip(shares, 0.0, 1.0).astype(np.float32)


@wp.func
def sheen_at(surface: Surface, material: int, cosine: float) -> wp.vec3:
    """Share of even light that the sheen of a material adds, at an angle from the normal."""
    place = wp.sqrt(wp.clamp(cosine, 0.0, 1.0)) * float(STEPS)
    low = wp.min(int(place), STEPS - 1)
    share = wp.lerp(
        surface.sheens[material, low], surface.sheens[material, low + 1], place - float(low)
    )
    return share * surface.data[material].sheen
