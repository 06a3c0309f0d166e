"""Regression of kernel gradients on twin gradients over many scenes: no factor hides in a tolerance."""

from dataclasses import fields

import numpy as np
import pytest

from digs_warp.splat.camera_gradient import camera_gradient
from digs_warp.splat.camera_motion import STILL, RowMotion
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer
from reference.splat_scenes import BACKGROUND, NEAR, camera, random_gaussians
from reference.splat_twin import Adjoints, Parameters, render_twin, twin_gradients

SEEDS = 100
VIEW = camera(12, 10, fx=14.0, fy=13.0)
OPTIONS = (RasterOptions(outputs="depth"), RasterOptions(outputs="depth", antialias=True))
CLASSES = (*(f.name for f in fields(Parameters)), "pose")


def gradients_of(seed: int, renderer: SplatRenderer) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Kernel and twin gradient of every class of parameters for one scene."""
    gaussians = random_gaussians(4, seed, degree=seed % 4)
    p, options = Parameters.of(gaussians), renderer.options
    rng = np.random.default_rng(seed)
    # Every fourth camera moves while its rows are read.
    rows = RowMotion(*rng.normal(size=(2, 3)) * 0.05) if seed % 8 in (1, 6) else STILL
    twin = render_twin(p, VIEW, NEAR, BACKGROUND, options, rows)
    clear = ~twin.ambiguous
    image = rng.normal(size=(10, 12, 3)) * clear[..., None]
    transmittance, depth = rng.normal(size=(2, 10, 12)) * clear
    adjoints = Adjoints(image, transmittance, depth)
    wanted = twin_gradients(p, VIEW, twin, BACKGROUND, adjoints, options, rows)
    renderer.set_gaussians(DeviceGaussians.from_numpy(gaussians))
    renderer.forward(VIEW, near=NEAR, background=BACKGROUND, rows=rows)
    renderer.adj_image.assign(adjoints.image)
    renderer.adj_transmittance.assign(adjoints.transmittance)
    renderer.adj_depth.assign(adjoints.depth)
    renderer.backward()
    found = {
        f.name: (array.numpy().reshape(-1), getattr(wanted.parameters, f.name).reshape(-1))
        for f, array in zip(fields(Parameters), renderer.gradients.arrays, strict=True)
    }
    motion = camera_gradient(gaussians, renderer.gradients.to_numpy(), VIEW)
    found["pose"] = motion, wanted.camera
    return found


def all_gradients() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    nothing = DeviceGaussians.from_numpy(random_gaussians(0, 0))
    renderers = [SplatRenderer(nothing, 12, 10, options=options) for options in OPTIONS]
    # Antialiasing on in every second block of four, so that it meets every degree of the harmonics.
    scenes = [gradients_of(seed, renderers[seed // 4 % 2]) for seed in range(SEEDS)]

    def joined(name: str, which: int) -> np.ndarray:
        return np.concatenate([scene[name][which] for scene in scenes])

    return {name: (joined(name, 0), joined(name, 1)) for name in CLASSES}


def test_the_slope_is_one() -> None:
    for name, (found, wanted) in all_gradients().items():
        assert np.abs(wanted).max() > 0.1, name
        assert found @ wanted / (wanted @ wanted) == pytest.approx(1.0, abs=1e-3), name
        # And no scatter around it: what one seed gets wrong does not vanish among the others.
        limit = 1e-4 * np.abs(wanted).max()
        np.testing.assert_allclose(found, wanted, rtol=0, atol=limit, err_msg=name)
