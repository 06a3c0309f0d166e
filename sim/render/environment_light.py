"""Prepares the light of an environment for the kernels: exposure, pyramid, irradiance and blurred copies.

The irradiance is that of Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment
Maps" (2001), eq. 7 and 8; see `digs_warp.sim.render.lighting`.
"""

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import ray_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.sh import sh_basis
from digs_warp.sim.render.lighting import (
    PI,
    SPECULAR_COPIES,
    SPECULAR_HEIGHT,
    SPECULAR_WIDTH,
    TWO_PI,
    KeyLights,
    Light,
    Panorama,
    panorama_at,
    panorama_uv,
    take_out_spots,
)
from digs_warp.sim.render.textures import mip_chain
from digs_warp.sim.scene.environment import Environment, panorama_directions, solid_angles

wp.set_module_options(ray_module_options())

# Linear value of a white card lit by the average of the surround; it leaves headroom for the side that
# faces the light.
WHITE_CARD = 0.65

# Samples of a blurred texel.
SPECULAR_SAMPLES = 64

# A curved mirror shrinks its reflection; this width [px] keeps sharp reflections free of aliasing.
MIRROR_WIDTH = 512

# Cosine lobe in spherical harmonics, bands 0, 1, 2 (Ramamoorthi and Hanrahan 2001, eq. 8).
COSINE_LOBE = np.array([np.pi] + [2 * np.pi / 3] * 3 + [np.pi / 4] * 5)


@wp.kernel
def _blur_kernel(
    first: int,
    panorama: Panorama,
    # outputs
    specular: wp.array[wp.vec3],  # [SPECULAR_COPIES * SPECULAR_HEIGHT * SPECULAR_WIDTH]
):
    """Average the panorama over the GGX lobe of a copy's roughness (Karis 2013, with n = v = r).

    Each of the samples reads the pyramid level whose texels are as large as its share of the lobe
    (filtered importance sampling, Krivanek and Colbert, GPU Gems 3, chapter 20, 2008).
    """
    index = first + wp.tid()
    column = index % SPECULAR_WIDTH
    row = (index // SPECULAR_WIDTH) % SPECULAR_HEIGHT
    copy = index // (SPECULAR_WIDTH * SPECULAR_HEIGHT)
    azimuth = (0.5 - (float(column) + 0.5) / float(SPECULAR_WIDTH)) * TWO_PI
    polar = (float(row) + 0.5) / float(SPECULAR_HEIGHT) * PI
    n = wp.vec3(wp.sin(polar) * wp.cos(azimuth), wp.sin(polar) * wp.sin(azimuth), wp.cos(polar))
    helper = wp.where(wp.abs(n[2]) < 0.9, wp.vec3(0.0, 0.0, 1.0), wp.vec3(1.0, 0.0, 0.0))
    tangent = wp.normalize(wp.cross(helper, n))
    bitangent = wp.cross(n, tangent)

    roughness = float(copy + 1) / float(SPECULAR_COPIES)
    a2 = wp.pow(roughness, 4.0)
    texel = 4.0 * PI / float(panorama.sizes[0][0] * panorama.sizes[0][1])
    total = wp.vec3(0.0)
    weight = wp.float32(0.0)
    for i in range(SPECULAR_SAMPLES):
        share = (float(i) + 0.5) / float(SPECULAR_SAMPLES)
        cos2 = (1.0 - share) / (1.0 + (a2 - 1.0) * share)
        cos_h = wp.sqrt(cos2)
        sin_h = wp.sqrt(1.0 - cos2)
        turn = float(i) * 2.399963229728653  # golden angle
        half = sin_h * (wp.cos(turn) * tangent + wp.sin(turn) * bitangent) + cos_h * n
        incoming = 2.0 * cos_h * half - n
        cos_l = wp.dot(incoming, n)
        if cos_l > 0.0:
            # Density of the half vector over that of directions, with n = v: D / 4.
            root = cos2 * (a2 - 1.0) + 1.0
            density = a2 / (4.0 * PI * root * root)
            solid_angle = 1.0 / (float(SPECULAR_SAMPLES) * density)
            level = 0.5 * wp.log2(solid_angle / texel)
            total += cos_l * panorama_at(panorama, panorama_uv(incoming), level)
            weight += cos_l
    specular[index] = total / weight


def irradiance_coefficients(radiance: np.ndarray) -> np.ndarray:
    """Return spherical-harmonics coefficients, shape (9, 3), of E(n) / pi.

    ``sh_basis(n, 2) @ coefficients`` is the light that a white matte surface with normal n reflects.
    """
    height, width = radiance.shape[:2]
    basis = sh_basis(panorama_directions(width, height), 2)
    return (
        np.einsum("hwk,hwc->kc", basis * solid_angles(width, height)[..., None], radiance)
        * (COSINE_LOBE / np.pi)[:, None]
    )


def light_from_above(coefficients: np.ndarray, keys: KeyLights) -> tuple[np.ndarray, np.ndarray]:
    """Return what a level white matte surface reflects, (3,) each: of the smooth light and of the spots.

    Args:
        coefficients: see `irradiance_coefficients`.
        keys: the spots.
    """
    up = np.array([[0.0, 0.0, 1.0]])
    smooth = np.maximum(sh_basis(up, 2) @ coefficients, 0.0)[0]
    if not keys.count:
        return smooth, np.zeros(3)
    return smooth, np.maximum(keys.vectors.numpy()[:, 2], 0.0) @ keys.colors.numpy()


def _pyramid(levels: list[np.ndarray]) -> Panorama:
    """Return levels, the finest first, each (height, width, 3), for the kernels."""
    panorama = Panorama()
    sizes = [(level.shape[1], level.shape[0]) for level in levels]
    counts = np.array(sizes, dtype=np.int32).prod(axis=1)
    texels = np.concatenate([level.reshape(-1, 3) for level in levels])
    panorama.texels = wp.array(texels, dtype=wp.vec3, device="cpu")
    panorama.sizes = wp.array(np.array(sizes, np.int32), dtype=wp.vec2i, device="cpu")
    starts = np.cumsum([0, *counts[:-1]]).astype(np.int32)
    panorama.offsets = wp.array(starts, dtype=int, device="cpu")
    panorama.levels = len(sizes)
    return panorama


def _blurred(panorama: Panorama, threads: int) -> Panorama:
    """Return the copies of a panorama that `Light` describes."""
    empty = np.zeros((SPECULAR_HEIGHT, SPECULAR_WIDTH, 3), np.float32)
    copies = _pyramid([empty] * SPECULAR_COPIES)
    launch_parallel(_blur_kernel, copies.texels.size, [panorama, copies.texels], threads=threads)
    return copies


def prepare_light(
    environment: Environment, threads: int = 0, below: np.ndarray | None = None
) -> tuple[float, Light]:
    """Return the exposure of the recording, and the light with it: pyramid, irradiance and blurred copies.

    Args:
        environment: the surround.
        threads: 0: all cores.
        below: albedo of a table top, (3,), that lights the objects from below in its place.
    """
    radiance = environment.radiance
    height, width = radiance.shape[:2]
    mean = float((radiance.mean(axis=2) * solid_angles(width, height)).sum() / (4 * np.pi))
    exposure = WHITE_CARD * environment.level / max(mean, 1e-12)
    levels = mip_chain(radiance * np.float32(exposure))
    small = next(level for level in levels if level.shape[1] <= 2 * SPECULAR_WIDTH)

    light = Light()
    light.panorama = _pyramid(levels)
    light.specular = _blurred(light.panorama, threads)
    smooth, light.keys = take_out_spots(small)
    light.rest = light.specular
    if light.keys.count:
        light.rest = _blurred(_pyramid(mip_chain(smooth)), threads)
    if below is not None:
        arriving = light_from_above(irradiance_coefficients(smooth), light.keys)
        smooth[smooth.shape[0] // 2 :] = below * sum(arriving)
    light.irradiance = wp.array(
        irradiance_coefficients(smooth).astype(np.float32), dtype=wp.vec3, device="cpu"
    )
    light.mirror_level = float(max(0.0, np.log2(width / MIRROR_WIDTH)))
    return exposure, light
