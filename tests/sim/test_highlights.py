"""Highlights against the integral over the GGX lobe, in double precision over every pixel of the panorama."""

import numpy as np
import pytest

from digs_warp.sim.environment import Environment
from digs_warp.sim.panorama import panorama_directions, solid_angles
from digs_warp.sim.render.environment_light import prepare_light
from digs_warp.sim.render.lighting import SPECULAR_COPIES, SPECULAR_HEIGHT, SPECULAR_WIDTH

HEIGHT = 128
DIRECTIONS = panorama_directions(2 * HEIGHT, HEIGHT)
# A lamp of 14 degrees, off the grid of the blurred copies.
LAMP = (slice(50, 60), slice(101, 111))


def lobe_mean(radiance: np.ndarray, normals: np.ndarray, roughness: float) -> np.ndarray:
    """Light around mirrored directions, (n, 3), weighted by GGX and the cosine, seen along the normal."""
    alpha2 = roughness**4
    cosine = DIRECTIONS.reshape(-1, 3) @ normals.T  # (pixels, n)
    half2 = (1 + cosine) / 2  # squared cosine of half the angle
    weight = np.maximum(cosine, 0) * alpha2 / (half2 * (alpha2 - 1) + 1) ** 2
    area = np.broadcast_to(solid_angles(2 * HEIGHT, HEIGHT), (HEIGHT, 2 * HEIGHT)).reshape(-1, 1)
    weight = weight * area
    return (weight.T @ radiance[..., 0].reshape(-1)) / weight.sum(axis=0)


@pytest.mark.parametrize("copy", range(SPECULAR_COPIES))
def test_a_highlight_is_as_wide_and_as_bright_as_its_roughness_says(copy: int) -> None:
    radiance = np.full((HEIGHT, 2 * HEIGHT, 3), 0.1, np.float32)
    radiance[LAMP] = 50.0
    light = prepare_light(Environment(radiance))
    found = light.struct.specular.numpy()[copy, :, :, 0] / light.exposure
    normals = panorama_directions(SPECULAR_WIDTH, SPECULAR_HEIGHT)
    # A row and a column through the lamp.
    places = np.concatenate([normals[27], normals[:, 53]])
    values = np.concatenate([found[27], found[:, 53]])
    roughness = (copy + 1) / SPECULAR_COPIES
    expected = lobe_mean(radiance.astype(np.float64), places, roughness)
    error = values - expected
    assert values.mean() == pytest.approx(expected.mean(), rel=0.03)
    assert np.sqrt((error**2).mean()) < 0.05 * expected.max()
    # A lobe of 15 percent less roughness would not pass.
    wrong = values - lobe_mean(radiance.astype(np.float64), places, roughness / 1.15)
    assert np.abs(wrong).max() > 2 * np.abs(error).max()
