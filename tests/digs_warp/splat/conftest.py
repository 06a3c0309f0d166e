"""Fixtures for the tests of the splat engine."""

import pytest
import warp as wp


@pytest.fixture(autouse=True)
def blocks_of_threads_on_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernels for CUDA run here as blocks of 256 threads, with barriers between them."""
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
