"""One case of a study: its labels, and the settings of its recording and its reconstruction."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from digs_warp.checks import DigsError
from digs_warp.record.files import digest
from digs_warp.words import did_you_mean

T = TypeVar("T")
STUDIED_CAMERA = "bare-matcher"  # errs more than a device; all published figures rest on it


@dataclass(frozen=True)
class Case:
    """One run of the chain.

    Attributes:
        labels: what the study varies, for its tables: ``{"object": "avocado", "strategy": "fusion"}``.
        recording: settings of `digs_warp.sim.config.SimulateConfig` that differ from the default.
        reconstruction: dotted settings of `digs_warp.pipeline.reconstruct.ReconstructConfig` that differ.
    """

    labels: Mapping[str, Any]
    recording: Mapping[str, Any] = field(default_factory=dict)
    reconstruction: Mapping[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Identifies the case across runs and machines: input files count by their names."""
        return digest([self.labels, with_file_names(self.recording), self.reconstruction])

    @property
    def recording_key(self) -> str:
        """Cases with the same key share one recording."""
        return digest(self.recording)

    @property
    def name(self) -> str:
        """The labels as words."""
        return " ".join(f"{key}={value}" for key, value in self.labels.items())


def with_file_names(recording: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a recording with the names of its input files instead of where they lie."""
    files = {
        key: Path(recording[key]).name for key in ("mesh", "environment") if recording.get(key)
    }
    return {**recording, **files}


def with_settings(config: T, changes: Mapping[str, Any]) -> T:
    """Return ``config`` with some settings changed; the new values are checked as usual.

    Args:
        config: a frozen dataclass; its fields may be frozen dataclasses, too.
        changes: dotted name -> value, for example ``{"init.voxel_size": 0.01, "test_every": 6}``.

    Raises:
        DigsError: an unknown name, or an invalid value.
    """
    # All changes of one dataclass at once: its settings are checked together, and one alone may be invalid.
    here: dict[str, Any] = {}
    below: dict[str, dict[str, Any]] = {}
    for name, value in changes.items():
        head, _, rest = name.partition(".")
        if rest:
            below.setdefault(head, {})[rest] = value
        else:
            here[head] = value
    for head, nested in below.items():
        here[head] = with_settings(_field(config, head, is_record=True), nested)
    for head in here:
        _field(config, head)
    return replace(config, **here)  # pyright: ignore[reportArgumentType, reportCallIssue]


def _field(config: Any, name: str, is_record: bool = False) -> Any:
    known = [f.name for f in fields(config)]
    if name not in known:
        raise DigsError(
            f"{type(config).__name__} has no setting '{name}'{did_you_mean(name, known)}"
        )
    value = getattr(config, name)
    if is_record and not is_dataclass(value):
        raise DigsError(f"{type(config).__name__}.{name} is a value, not a group of settings")
    return value
