"""What the tests of the commands share."""

from collections.abc import Callable

import pytest

from digs_warp.cli import main

Run = Callable[..., tuple[int, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command line; give its exit code and all that it printed."""

    def run(*words: object) -> tuple[int, str]:
        code = main([*map(str, words)])
        return code, "".join(capsys.readouterr())

    return run
