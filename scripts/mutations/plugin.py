"""A plug-in of pytest that puts a fault into the program before any test is imported.

DIGS_WARP_MUTATION=noise-1.3 python -m pytest -p mutations.plugin tests/...
"""

import os

import pytest

from mutations.catalogue import find_mutation

VARIABLE = "DIGS_WARP_MUTATION"


def pytest_configure(config: pytest.Config) -> None:
    """Apply the mutation that the environment names, if any, for the life of the process."""
    if name := os.environ.get(VARIABLE):
        find_mutation(name).apply(pytest.MonkeyPatch())
