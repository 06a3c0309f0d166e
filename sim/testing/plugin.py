"""pytest plug-in, active wherever this package is installed: marker and fixture ``sensor_noise``.

    @pytest.mark.sensor_noise(strengths=(0, 1, 2, 4))
    def test_my_function_survives_noise(sensor_noise):
        sensor_noise.measure(my_error).assert_no_cliff()

docs/sensor-noise-plugin.md explains it. The simulator is imported only when a test uses the fixture.
"""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.record.fields import shown
from digs_warp.sim.testing.effects import EachEffect
from digs_warp.sim.testing.summary import MARKER, SummaryWriter
from digs_warp.words import did_you_mean

if TYPE_CHECKING:
    from digs_warp.sim.config import SimulateConfig
    from digs_warp.sim.testing.series import NoiseSeries

REPORT_OPTION = "--sensor-noise-report"
DEFAULT_STRENGTHS = (0, 1, 2, 4)

# Few and small frames, for tests: about a second to simulate, once.
DEFAULT_SETTINGS: Mapping[str, Any] = {
    "frames": 6,
    "width": 160,
    "height": 120,
    "tier": "guided",
}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the flag of the summary."""
    group = parser.getgroup(MARKER, "sensor noise")
    group.addoption(
        REPORT_OPTION,
        metavar="FILE",
        help="write how every measured error grows with the sensor's noise to this HTML page",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Describe the marker, and start the summary if it is wanted."""
    if path := config.getoption(REPORT_OPTION):
        config.pluginmanager.register(SummaryWriter(Path(path)), "sensor noise summary")
    config.addinivalue_line(
        "markers",
        f"{MARKER}(effects='auto', strengths={DEFAULT_STRENGTHS}, **settings): captures for the fixture "
        f"'{MARKER}', simulated at rising sensor noise; settings are those of "
        "digs_warp.sim.config.SimulateConfig",
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


@pytest.fixture
def sensor_noise(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> "NoiseSeries":
    """Simulated captures at rising sensor noise, as the test's marker describes them.

    pytest's cache keeps them between runs (``pytest --cache-clear`` removes them).
    """
    from digs_warp.sim.testing.series import CaptureCache, NoiseSeries

    effect = getattr(request, "param", None)
    config, strengths = read_marker(request.node.get_closest_marker(MARKER), effect)
    # If pytest's cache is disabled, captures last as long as the run.
    cache = getattr(request.config, "cache", None)
    folder = cache.mkdir("sensor_noise") if cache else tmp_path_factory.mktemp(MARKER)
    properties = (
        request.node.user_properties
    )  # part of the test's report, also from another process
    return NoiseSeries(
        config,
        strengths,
        CaptureCache(folder),
        on_curve=lambda what, curve: properties.append((MARKER, curve.to_json() | {"of": what})),
    )


def read_marker(
    marker: pytest.Mark | None, effect: str | None = None
) -> "tuple[SimulateConfig, tuple[float, ...]]":
    """Return the settings of a test's recordings and the strengths of their noise.

    Args:
        marker: of the test.
        effect: the one of the marker's `each` that this test is about; None: all of them.

    Raises:
        DigsError: a setting or an effect that does not exist, a value that it cannot have, or strengths that
            do not rise.
    """
    from digs_warp.sim.config import SimulateConfig
    from digs_warp.sim.sensor_plan import check_effects
    from digs_warp.sim.testing.series import check_strengths

    settings = dict(marker.kwargs) if marker else {}
    if marker and marker.args:
        raise DigsError(f"found {shown(marker.args)}, expected keyword arguments only")
    strengths = check_strengths(settings.pop("strengths", DEFAULT_STRENGTHS))
    known = [field.name for field in fields(SimulateConfig) if field.name != "strength"]
    if unknown := sorted(settings.keys() - known):
        raise DigsError(
            f"no setting '{unknown[0]}'{did_you_mean(unknown[0], ['strengths', *known])}"
        )
    values = {**DEFAULT_SETTINGS, **settings}
    effects = values.get("effects", "")
    if isinstance(effects, EachEffect):
        effects = effects.names if effect is None else (effect,)
    if not isinstance(effects, str):
        effects = ",".join(effects)
    if effects:
        values["effects"] = effects
    for name in ("mesh", "environment"):
        if values.get(name) is not None:
            values[name] = Path(values[name])
    config = SimulateConfig(**values)
    check_effects(config)
    return config, strengths
