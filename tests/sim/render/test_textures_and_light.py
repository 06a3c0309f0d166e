"""Mip pyramids keep their mean; irradiance and exposure agree with direct integration."""

import numpy as np
import pytest

from digs_warp.geometry.sh import sh_basis
from digs_warp.sim.render.environment_light import (
    WHITE_CARD,
    irradiance_coefficients,
    prepare_light,
)
from digs_warp.sim.render.lighting import SPECULAR_COPIES
from digs_warp.sim.render.textures import mip_chain
from digs_warp.sim.scene.environment import Environment, panorama_directions, solid_angles


@pytest.mark.parametrize("shape", [(64, 64), (17, 5), (1, 9), (100, 37), (1, 1)])
def test_every_level_of_a_pyramid_has_the_mean_of_the_image(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(0).uniform(0, 1, (*shape, 3)).astype(np.float32)
    chain = mip_chain(image)
    assert chain[-1].shape == (1, 1, 3)
    for level in chain:
        np.testing.assert_allclose(level.mean(axis=(0, 1)), image.mean(axis=(0, 1)), atol=1e-5)


def test_irradiance_is_the_cosine_integral_of_a_smooth_sky() -> None:
    directions = panorama_directions(128, 64)
    radiance = 1 + 0.5 * directions[..., 2:] + 0.3 * directions[..., :1] * directions[..., 1:2]
    radiance = np.repeat(radiance, 3, axis=-1)
    normals = np.array([[0, 0, 1.0], [0.6, 0, -0.8], [-0.48, 0.6, 0.64]])
    found = sh_basis(normals, 2) @ irradiance_coefficients(radiance)
    cosine = np.maximum(np.einsum("nc,hwc->nhw", normals, directions), 0.0)
    weights = cosine * solid_angles(128, 64)
    expected = np.einsum("nhw,hwc->nc", weights, radiance) / np.pi
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def test_exposure_puts_a_white_card_where_it_belongs_whatever_the_brightness() -> None:
    radiance = np.random.default_rng(0).uniform(0, 1, (32, 64, 3)).astype(np.float32)
    (dim, faint), (bright, strong) = (
        prepare_light(Environment(radiance * gain)) for gain in (1e-3, 1e3)
    )
    assert dim == pytest.approx(1e6 * bright, rel=1e-4)
    means = [light.irradiance.numpy()[0] * 0.28209479177387814 for light in (faint, strong)]
    assert means[0].mean() == pytest.approx(WHITE_CARD, rel=0.02)
    np.testing.assert_allclose(*means, rtol=1e-4)


def test_blurred_copies_keep_the_mean_and_lose_contrast() -> None:
    radiance = np.random.default_rng(0).uniform(0, 1, (64, 128, 3)).astype(np.float32)
    radiance[10:20, 30:40] = 20.0
    _, light = prepare_light(Environment(radiance))
    copies = light.specular.texels.numpy().reshape(SPECULAR_COPIES, 64, 128, 3)
    assert np.isfinite(copies).all()
    weights = solid_angles(128, 64)[..., None] / (4 * np.pi)
    means = (copies * weights).sum(axis=(1, 2))
    np.testing.assert_allclose(means, np.broadcast_to(means[0], means.shape), rtol=0.05)
    peaks = copies.max(axis=(1, 2, 3))
    assert (np.diff(peaks) < 0).all()
