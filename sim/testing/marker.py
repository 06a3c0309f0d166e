"""Reads the marker ``sensor_noise`` of a test: what its captures are made of, and at which strengths."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.record.fields import shown
from digs_warp.words import did_you_mean

if TYPE_CHECKING:
    from digs_warp.sim.testing.sources import NoiseSource, SimulatedWalk, WorseRecording


@dataclass(frozen=True)
class EachEffect:
    """Effects of which every test sees one; made by `each`."""

    names: tuple[str, ...]


def each(*effects: str) -> EachEffect:
    """Make one test for each effect: ``@pytest.mark.sensor_noise(effects=each("shot-noise", "quantum"))``.

    The names are those that `digs-warp plan` and docs/sensor.md give; the ids of the tests end with them.
    """
    return EachEffect(effects)


DEFAULT_STRENGTHS = (0, 1, 2, 4)

# Few and small frames, for tests: about a second to simulate, once.
DEFAULT_SETTINGS: Mapping[str, Any] = {
    "frames": 6,
    "width": 160,
    "height": 120,
    "tier": "guided",
}


def read_marker(
    marker: pytest.Mark | None, effect: str | None = None
) -> "tuple[NoiseSource, tuple[float, ...]]":
    """Return the source of a test's recordings and the strengths of their noise.

    Args:
        marker: of the test.
        effect: the one of the marker's `each` that this test is about; None: all of them.

    Raises:
        DigsError: a setting or an effect that does not exist or does not fit a recording, a value that it
            cannot have, a recording that cannot be used, or strengths that do not rise.
    """
    from digs_warp.sim.config import SimulateConfig
    from digs_warp.sim.testing.recording import RecordingConfig
    from digs_warp.sim.testing.series import check_strengths

    settings = dict(marker.kwargs) if marker else {}
    if marker and marker.args:
        raise DigsError(f"found {shown(marker.args)}, expected keyword arguments only")
    strengths = check_strengths(settings.pop("strengths", DEFAULT_STRENGTHS))
    of_walks = [field.name for field in fields(SimulateConfig) if field.name != "strength"]
    of_recordings = [field.name for field in fields(RecordingConfig)]
    known = {*of_walks, *of_recordings}
    if unknown := sorted(settings.keys() - known):
        raise DigsError(
            f"no setting '{unknown[0]}'{did_you_mean(unknown[0], ['strengths', *sorted(known)])}"
        )
    if "effects" in settings:
        settings["effects"] = _effects(settings["effects"], effect)
    if settings.get("capture") is None:
        settings.pop("capture", None)
        return _walk(settings), strengths
    if unfit := sorted(settings.keys() - set(of_recordings)):
        raise DigsError(
            f"'{unfit[0]}' is a setting of simulated recordings, and 'capture' names a real one: leave out "
            f"one of the two (beside 'capture': {', '.join(of_recordings[1:])}, strengths)"
        )
    return _recording(settings), strengths


def _effects(effects: Any, effect: str | None) -> str:
    """Return the effects as the settings have them, separated by commas."""
    if isinstance(effects, EachEffect):
        effects = effects.names if effect is None else (effect,)
    names = effects if isinstance(effects, str) else ",".join(effects)
    if not names:  # pytest would skip a test for each of no effects without a word
        raise DigsError(
            "effects: found no name, expected some, such as 'shot-noise'; leave 'effects' out for what the "
            "scene calls for, or say 'none'"
        )
    return names


def _walk(settings: dict[str, Any]) -> "SimulatedWalk":
    from digs_warp.record.files import plain
    from digs_warp.record.typed import from_json
    from digs_warp.sim.config import SimulateConfig
    from digs_warp.sim.record.inputs import rig_of
    from digs_warp.sim.record.sensor_plan import check_effects
    from digs_warp.sim.testing.sources import SimulatedWalk

    config = from_json(
        SimulateConfig, plain({**DEFAULT_SETTINGS, **settings}), "settings", strict=True
    )
    check_effects(config)
    rig_of(config)  # refuses a wrong profile
    for path in config.input_files:
        if path and not path.exists():
            raise DigsError(
                f"'{path}': no such file; a relative path starts where pytest runs, here '{Path.cwd()}'"
            )
    return SimulatedWalk(config)


def _recording(settings: dict[str, Any]) -> "WorseRecording":
    from digs_warp.record.files import plain
    from digs_warp.record.typed import from_json
    from digs_warp.sim.testing.recording import OwnRecording, RecordingConfig
    from digs_warp.sim.testing.sources import WorseRecording

    config = from_json(RecordingConfig, plain(settings), "settings", strict=True)
    return WorseRecording(OwnRecording.of(config))
