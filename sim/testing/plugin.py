"""pytest plug-in, active wherever this package is installed: marker and fixture ``sensor_noise``.

    @pytest.mark.sensor_noise(strengths=(0, 1, 2, 4))
    def test_my_function_survives_noise(sensor_noise):
        sensor_noise.measure(my_error).assert_no_cliff()

docs/sensor-noise-plugin.md explains it. The simulator is imported only when a test uses the fixture.
"""

import os
from typing import TYPE_CHECKING

import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.testing.marker import DEFAULT_STRENGTHS, EachEffect, read_marker

if TYPE_CHECKING:
    from digs_warp.sim.testing.series import NoiseSeries

MARKER = "sensor_noise"
FOREIGN = os.path.join("dash", "testing", "plugin.py")


def pytest_configure(config: pytest.Config) -> None:
    """Describe the marker."""
    config.addinivalue_line(
        "markers",
        f"{MARKER}(effects='auto', strengths={DEFAULT_STRENGTHS}, **settings): captures for the fixture "
        f"'{MARKER}' at rising sensor noise: simulated, with the settings of "
        "digs_warp.sim.config.SimulateConfig, or those of a recording: capture=FOLDER",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make a test for each effect where the marker asks for it."""
    marker = metafunc.definition.get_closest_marker(MARKER)
    effects = marker.kwargs.get("effects") if marker else None
    if isinstance(effects, EachEffect) and MARKER in metafunc.fixturenames:
        metafunc.parametrize(MARKER, effects.names, indirect=True)


@pytest.hookimpl(trylast=True)  # after pytest left out the tests that -k and -m do not select
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Refuse wrong markers before the first test runs, in one line that names the test."""
    for item in items:
        if marker := item.get_closest_marker(MARKER):
            try:
                read_marker(marker)
            except DigsError as error:
                raise pytest.UsageError(f"{item.nodeid}: @pytest.mark.{MARKER}: {error}") from None


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Leave out that the plug-in of a package that Open3D brings uses old hooks: no user can change that."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    warned = reporter.stats.get("warnings", []) if reporter else []
    warned[:] = [each for each in warned if FOREIGN not in str(each.fslocation)]


@pytest.fixture
def sensor_noise(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> "NoiseSeries":
    """Captures at rising sensor noise, as the test's marker describes them.

    pytest's cache keeps them between runs (``pytest --cache-clear`` removes them).
    """
    from digs_warp.sim.testing.series import CaptureCache, NoiseSeries

    effect = getattr(request, "param", None)
    source, strengths = read_marker(request.node.get_closest_marker(MARKER), effect)
    # If pytest's cache is disabled, captures last as long as the run.
    cache = getattr(request.config, "cache", None)
    folder = cache.mkdir("sensor_noise") if cache else tmp_path_factory.mktemp(MARKER)
    # Part of the test's report, also from another process.
    properties = request.node.user_properties
    return NoiseSeries(
        source,
        strengths,
        CaptureCache(folder),
        on_curve=lambda what, curve: properties.append((MARKER, curve.to_json() | {"of": what})),
    )
