"""One case of a study: its labels, and the settings of its recording and its reconstruction."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import reduce
from pathlib import Path
from typing import Any, TypeVar

from digs_warp.record.files import digest
from digs_warp.record.typed import from_json, to_json

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


def with_file_names(recording: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a recording with the names of its input files instead of where they lie."""
    files = {
        key: Path(recording[key]).name for key in ("mesh", "environment") if recording.get(key)
    }
    return {**recording, **files}


def with_settings(config: T, changes: Mapping[str, Any]) -> T:
    """Return ``config`` with some settings changed; the new values are checked as usual, all together.

    Args:
        config: a frozen dataclass; its fields may be frozen dataclasses, too.
        changes: dotted name -> value, for example ``{"init.voxel_size": 0.01, "test_every": 6}``.

    Raises:
        DigsError: an unknown name, or an invalid value.
    """
    values = to_json(config)
    for name, value in changes.items():
        *groups, last = name.split(".")
        reduce(lambda group, part: group.setdefault(part, {}), groups, values)[last] = value
    return from_json(type(config), values, "settings of a case", strict=True)
