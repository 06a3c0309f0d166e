"""The kernels against the float64 twin: all outputs and all gradients, random scenes and hard cases."""

from dataclasses import dataclass, fields

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera
from digs_warp.splat.backend import RasterBackend
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.splat.render import SplatRenderer
from reference.splat_scenes import (
    BACKENDS,
    BACKGROUND,
    SplatScene,
    backend_name,
    hard_cases,
    random_scene,
    rolling_scene,
)
from reference.splat_twin import (
    Adjoints,
    Parameters,
    TwinGradients,
    TwinImage,
    render_twin,
    twin_gradients,
)

# The polynomial for exp is good to 2e-6 relative, float32 sums to about 1e-7 a step.
IMAGE_TOLERANCE = 5e-6
# Relative to the largest gradient of a parameter class: float32 sums over some hundred pixels whose terms
# cancel (observed: below 4e-6 on random scenes). Depth divides by the coverage, of which there may be little.
GRADIENT_TOLERANCE, DEPTH_TOLERANCE = 2e-5, 3e-4
# A conic of a needle or of a splat across the image is the small difference of large numbers in float32.
STIFF_TOLERANCE = 1e-3
STIFF = (
    "needles of 10,000 to 1",
    "straddles the near plane",
    "covers the whole image",
    "just before the near plane",
    "saturated pixels",
    "saturated tiles",
)

HARD = hard_cases()
RANDOM = [random_scene(seed) for seed in range(4)]
ROLLING = [rolling_scene(seed) for seed in (1, 2)]
# Dilated, as needles ask for; the others draw as the training does.
COLOR = RasterOptions(dilation=0.3)
ALL = RasterOptions(dilation=0.3, outputs="depth")
ANTIALIASED = RasterOptions(dilation=0.3, outputs="depth", antialias=True)


@dataclass(frozen=True, eq=False)
class Expected:
    """What the twin says of a scene, for random image gradients."""

    twin: TwinImage
    adjoints: Adjoints
    gradients: TwinGradients


def random_adjoints(camera: Camera, where: np.ndarray) -> Adjoints:
    """Gradients of all outputs, zero outside of ``where``."""
    k = camera.intrinsics
    rng = np.random.default_rng(0)
    size = (k.height, k.width)
    return Adjoints(
        rng.normal(size=(*size, 3)) * where[..., None],
        rng.normal(size=size) * where,
        rng.normal(size=size) * where,
    )


def expected_of(scene: SplatScene, options: RasterOptions) -> Expected:
    p = Parameters.of(scene.gaussians)
    twin = render_twin(p, scene.camera, scene.near, BACKGROUND, options, rows=scene.rows)
    adjoints = random_adjoints(scene.camera, ~twin.ambiguous)
    if not options.has_depth:
        adjoints.depth[:] = 0
    gradients = twin_gradients(p, scene.camera, twin, BACKGROUND, adjoints, options, scene.rows)
    return Expected(twin, adjoints, gradients)


def renderer_of(scene: SplatScene, adjoints: Adjoints, **options) -> SplatRenderer:
    """A renderer that has drawn the scene and pulled the adjoints back."""
    k = scene.camera.intrinsics
    renderer = SplatRenderer(
        DeviceGaussians.from_numpy(scene.gaussians),
        k.width,
        k.height,
        **options,
    )
    renderer.statistics = SplatStatistics.zeros(len(scene.gaussians))
    renderer.forward(scene.camera, near=scene.near, background=BACKGROUND, rows=scene.rows)
    renderer.adj_image.assign(adjoints.image)
    renderer.adj_transmittance.assign(adjoints.transmittance)
    if renderer.options.has_depth:
        renderer.adj_depth.assign(adjoints.depth)
    renderer.backward()
    return renderer


def check_close(found: np.ndarray, wanted: np.ndarray, tolerance: float, name: str) -> None:
    """Equal to ``tolerance`` of the largest value."""
    assert np.isfinite(found).all(), name
    limit = tolerance * max(np.abs(wanted).max(initial=0), 1e-2)
    np.testing.assert_allclose(
        found.reshape(wanted.shape), wanted, rtol=0, atol=limit, err_msg=name
    )


def check_against_twin(
    scene: SplatScene, options: RasterOptions = COLOR, stiff: bool = False
) -> None:
    """Every backend against the twin: images, gradients of parameters, statistics."""
    expected = expected_of(scene, options)
    for backend in BACKENDS:
        check_backend(scene, expected, backend, options, stiff)


def check_backend(
    scene: SplatScene,
    expected: Expected,
    backend: RasterBackend,
    options: RasterOptions,
    stiff: bool,
) -> None:
    twin, clear = expected.twin, ~expected.twin.ambiguous
    renderer = renderer_of(scene, expected.adjoints, options=options, backend=backend)

    # A decision within rounding of its threshold may go either way: few pixels, left out.
    assert twin.ambiguous.mean() <= 0.05
    tolerance = STIFF_TOLERANCE if stiff else IMAGE_TOLERANCE
    pairs = [(renderer.image, twin.image), (renderer.transmittance, twin.transmittance)]
    if options.has_depth:
        pairs.append((renderer.depth, np.stack([twin.depth, twin.median_depth], axis=-1)))
    for planes, wanted in pairs:
        found = planes.to_numpy().reshape(wanted.shape)
        # Depths are not within 0..1 as colors are: float32 is as good relative to their size.
        limit = tolerance * max(1.0, float(np.abs(wanted[clear]).max(initial=0)))
        np.testing.assert_allclose(
            found[clear], wanted[clear], rtol=0, atol=limit, err_msg=backend_name(backend)
        )

    tolerance = DEPTH_TOLERANCE if options.has_depth else GRADIENT_TOLERANCE
    tolerance = STIFF_TOLERANCE if stiff else tolerance
    wanted = expected.gradients
    for field, array in zip(fields(Parameters), renderer.gradients.arrays, strict=True):
        check_close(array.numpy(), getattr(wanted.parameters, field.name), tolerance, field.name)

    k, statistics = scene.camera.intrinsics, renderer.statistics
    assert statistics is not None
    half = 0.5 * np.array([k.width, k.height])
    sums = np.linalg.norm(wanted.centers * half, axis=1)
    check_close(statistics.gradient_sums.numpy(), sums, tolerance, "gradient sums")


@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_equal_the_twin(seed: int) -> None:
    check_against_twin(RANDOM[seed])


@pytest.mark.parametrize(
    ("seed", "options"), [(0, ALL), (1, ALL), (0, ANTIALIASED), (1, ANTIALIASED)]
)
def test_all_outputs_and_options_equal_the_twin(seed: int, options: RasterOptions) -> None:
    check_against_twin(RANDOM[seed], options)


@pytest.mark.parametrize(("seed", "options"), [(0, COLOR), (1, ALL)], ids=["color", "all"])
def test_rolling_shutters_equal_the_twin(seed: int, options: RasterOptions) -> None:
    check_against_twin(ROLLING[seed], options)


@pytest.mark.parametrize("name", HARD)
def test_hard_cases_equal_the_twin(name: str) -> None:
    check_against_twin(HARD[name], stiff=name in STIFF)
