"""Effects of the sensor as parameters of a test."""

from dataclasses import dataclass


@dataclass(frozen=True)
class EachEffect:
    """Effects of which every test sees one; made by `each`."""

    names: tuple[str, ...]


def each(*effects: str) -> EachEffect:
    """Make one test for each effect: ``@pytest.mark.sensor_noise(effects=each("shot-noise", "quantum"))``.

    The names are those that `digs-warp plan` and docs/sensor.md give; the ids of the tests end with them.
    """
    return EachEffect(effects)
