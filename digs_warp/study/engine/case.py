"""One case of a study: what is recorded, how it is reconstructed, and what tells it from the others."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from digs_warp.log import to_json


@dataclass(frozen=True)
class Case:
    """One run of the chain.

    Attributes:
        labels: what the study varies, for its tables: ``{"object": "avocado", "strategy": "fusion"}``.
        recording: settings of `sim.config.SimulateConfig` that differ from the default.
        reconstruction: dotted settings of `digs_warp.reconstruct.ReconstructConfig` that differ.
    """

    labels: Mapping[str, Any]
    recording: Mapping[str, Any] = field(default_factory=dict)
    reconstruction: Mapping[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Identifies the case across runs: the same labels and settings have the same key."""
        return digest([self.labels, self.recording, self.reconstruction])

    @property
    def recording_key(self) -> str:
        """Cases with the same key share one recording."""
        return digest(self.recording)

    @property
    def name(self) -> str:
        """The labels as words."""
        return " ".join(f"{key}={value}" for key, value in self.labels.items())


@dataclass(frozen=True)
class Study:
    """A question, and the cases that answer it.

    Attributes:
        name: as the command line takes it.
        summary: one line for the help.
        cases: the cases, those that matter most first: a study cut to a time budget keeps them.
        sections: what the report draws from the records; see `digs_warp.study.engine.page`.
    """

    name: str
    summary: str
    cases: Callable[[], Sequence[Case]]
    sections: Callable[[Sequence[Mapping[str, Any]]], Sequence[Any]]


def digest(value: Any) -> str:
    """Return 16 hexadecimal digits that identify a JSON-like value; the order of keys does not matter."""
    plain = json.dumps(json.loads(to_json(value)), sort_keys=True)
    return hashlib.sha256(plain.encode()).hexdigest()[:16]
