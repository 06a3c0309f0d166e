"""Fixtures for the USD tests."""

import pytest

from digs_warp.usd import files


@pytest.fixture(autouse=True)
def sound_scenes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes that tests write need no trial, which takes 0.2 s each; those of hostile ones do."""
    if "hostile" not in request.module.__name__:
        monkeypatch.setattr(files, "_try_apart", lambda path: None)
