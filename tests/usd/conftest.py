"""Fixtures for the USD tests."""

from collections.abc import Callable

import numpy as np
import pytest

from digs_warp.data.gaussians import Gaussians
from digs_warp.usd import files


@pytest.fixture(scope="session")
def random_gaussians() -> Callable[..., Gaussians]:
    """Make Gaussians of every shape and view dependence: ``random_gaussians(count, degree, seed)``."""

    def make(count: int, degree: int = 3, seed: int = 0) -> Gaussians:
        random = np.random.default_rng(seed)
        return Gaussians(
            means=random.normal(size=(count, 3)),
            log_scales=random.normal(-4.0, 1.0, size=(count, 3)),
            quats=random.normal(size=(count, 4)) * random.uniform(0.1, 9.0, size=(count, 1)),
            opacity_logits=random.normal(0.0, 2.0, size=count),
            sh=random.normal(0.0, 0.3, size=(count, (degree + 1) ** 2, 3)),
        )

    return make


@pytest.fixture(autouse=True)
def sound_scenes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes that tests write need no trial, which takes 0.2 s each; those of hostile ones do."""
    if "hostile" not in request.module.__name__:
        monkeypatch.setattr(files, "_try_apart", lambda path: None)
