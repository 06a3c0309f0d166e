"""Fixtures for the USD tests."""

from collections.abc import Callable

import pytest

from digs_warp.data.gaussians import Gaussians
from digs_warp.usd import files
from reference import splat_files


@pytest.fixture(scope="session")
def random_gaussians() -> Callable[..., Gaussians]:
    """Make Gaussians of every shape and view dependence: ``random_gaussians(count, degree, seed)``."""
    return lambda count, degree=3, seed=0: splat_files.random_gaussians(count, degree, seed)


@pytest.fixture(autouse=True)
def sound_scenes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes that tests write need no trial, which takes 0.2 s each; those of hostile ones do."""
    if "hostile" not in request.module.__name__:
        monkeypatch.setattr(files, "_try_apart", lambda path: None)
