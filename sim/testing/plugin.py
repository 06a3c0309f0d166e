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

if TYPE_CHECKING:
    from digs_warp.sim.testing.series import NoiseSeries

MARKER = "sensor_noise"
DEFAULT_STRENGTHS = (0, 1, 2, 4)

# Few and small frames, for tests: about a second to simulate, once.
DEFAULT_SETTINGS: Mapping[str, Any] = {
    "frames": 6,
    "width": 160,
    "height": 120,
    "tier": "planned",
}


def pytest_configure(config: pytest.Config) -> None:
    """Describe the marker."""
    config.addinivalue_line(
        "markers",
        f"{MARKER}(effects='auto', strengths={DEFAULT_STRENGTHS}, **settings): captures for the fixture "
        f"'{MARKER}', simulated at rising sensor noise; settings are those of "
        "digs_warp.sim.config.SimulateConfig",
    )


@pytest.fixture
def sensor_noise(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> "NoiseSeries":
    """Simulated captures at rising sensor noise, as the test's marker describes them.

    pytest's cache keeps them between runs (``pytest --cache-clear`` removes them).
    """
    from digs_warp.sim.testing.series import CaptureCache, NoiseSeries

    marker = request.node.get_closest_marker(MARKER)
    settings = dict(marker.kwargs) if marker else {}
    if marker and marker.args:
        raise pytest.UsageError(f"@pytest.mark.{MARKER} takes keyword arguments only")
    strengths = tuple(settings.pop("strengths", DEFAULT_STRENGTHS))
    # If pytest's cache is disabled, captures last as long as the run.
    cache = getattr(request.config, "cache", None)
    folder = cache.mkdir("sensor_noise") if cache else tmp_path_factory.mktemp(MARKER)
    return NoiseSeries(_config(settings), strengths, CaptureCache(folder))


def _config(settings: dict[str, Any]) -> Any:
    from digs_warp.sim.config import SimulateConfig

    known = {field.name for field in fields(SimulateConfig)} - {"strength"}
    if unknown := sorted(settings.keys() - known):
        raise pytest.UsageError(
            f"@pytest.mark.{MARKER}: unknown {', '.join(unknown)}; expected strengths or one of "
            f"{', '.join(sorted(known))}"
        )
    values = {**DEFAULT_SETTINGS, **settings}
    if not isinstance(values.get("effects", ""), str):
        values["effects"] = ",".join(values["effects"])
    for name in ("mesh", "environment"):
        if values.get(name) is not None:
            values[name] = Path(values[name])
    return SimulateConfig(**values)
