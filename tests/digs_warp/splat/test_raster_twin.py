"""The kernels against the float64 twin: images and gradients, random scenes and hard cases."""

from dataclasses import dataclass, fields
from functools import cache

import numpy as np
import pytest
from reference.splat_scenes import BACKGROUND, SplatScene, hard_cases, random_scene
from reference.splat_twin import Parameters, TwinImage, render_twin, twin_gradients

from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer

# The polynomial for exp is good to 2e-6 relative, float32 sums to about 1e-7 a step.
IMAGE_TOLERANCE = 5e-6
# Relative to the largest gradient of a parameter class: float32 sums over some hundred pixels whose terms
# cancel (observed: below 4e-6 on random scenes).
GRADIENT_TOLERANCE = 2e-5
# A conic of a needle or of a splat across the image is the small difference of large numbers in float32.
STIFF_TOLERANCE = 1e-3
STIFF = (
    "needles",
    "covers the whole image",
    "just before the near plane",
    "saturated pixels",
    "saturated tiles",
)

HARD = hard_cases()
RANDOM = [random_scene(seed) for seed in range(4)]


@dataclass(frozen=True, eq=False)
class Expected:
    """What the twin says of a scene, for random image gradients."""

    twin: TwinImage
    adj_image: np.ndarray
    adj_transmittance: np.ndarray
    gradients: Parameters


@cache
def expected_of(scene: SplatScene) -> Expected:
    k = scene.camera.intrinsics
    p = Parameters.of(scene.gaussians)
    twin = render_twin(p, scene.camera, scene.near, BACKGROUND)
    clear = ~twin.ambiguous
    rng = np.random.default_rng(0)
    adj_image = rng.normal(size=(k.height, k.width, 3)) * clear[..., None]
    adj_transmittance = rng.normal(size=(k.height, k.width)) * clear
    gradients = twin_gradients(
        p, scene.camera, scene.near, BACKGROUND, adj_image, adj_transmittance
    )
    return Expected(twin, adj_image, adj_transmittance, gradients)


def check_against_twin(scene: SplatScene, vectorized: bool, stiff: bool = False) -> None:
    expected = expected_of(scene)
    twin, k = expected.twin, scene.camera.intrinsics
    clear = ~twin.ambiguous

    renderer = SplatRenderer(
        DeviceGaussians.from_numpy(scene.gaussians), k.width, k.height, vectorized=vectorized
    )
    renderer.forward(scene.camera, near=scene.near, background=BACKGROUND)
    renderer.adj_image.assign(expected.adj_image)
    renderer.adj_transmittance.assign(expected.adj_transmittance)
    renderer.backward()

    # A decision within rounding of its threshold may go either way: few pixels, left out.
    assert twin.ambiguous.mean() <= 0.05
    scale = STIFF_TOLERANCE / IMAGE_TOLERANCE if stiff else 1.0
    difference = np.abs(renderer.image.to_numpy() - twin.image).max(axis=-1)[clear]
    assert difference.max(initial=0) < IMAGE_TOLERANCE * scale
    transmittance = renderer.transmittance.to_numpy()[..., 0]
    np.testing.assert_allclose(
        transmittance[clear], twin.transmittance[clear], atol=IMAGE_TOLERANCE * scale
    )
    tolerance = STIFF_TOLERANCE if stiff else GRADIENT_TOLERANCE
    for field, array in zip(fields(Parameters), renderer.gradients.arrays, strict=True):
        wanted = getattr(expected.gradients, field.name)
        found = array.numpy().reshape(wanted.shape)
        assert np.isfinite(found).all(), field.name
        limit = tolerance * max(np.abs(wanted).max(initial=0), 1e-2)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=limit, err_msg=field.name)


@pytest.mark.parametrize("vectorized", [True, False], ids=["vectorized", "per pixel"])
@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_equal_the_twin(seed: int, vectorized: bool) -> None:
    check_against_twin(RANDOM[seed], vectorized)


@pytest.mark.parametrize("vectorized", [True, False], ids=["vectorized", "per pixel"])
@pytest.mark.parametrize("name", HARD)
def test_hard_cases_equal_the_twin(name: str, vectorized: bool) -> None:
    check_against_twin(HARD[name], vectorized, stiff=name in STIFF)
