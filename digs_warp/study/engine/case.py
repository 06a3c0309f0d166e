"""One case of a study: what is recorded, how it is reconstructed, and what tells it from the others."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from digs_warp.record.files import to_json


@dataclass(frozen=True)
class Case:
    """One run of the chain.

    Attributes:
        labels: what the study varies, for its tables: ``{"object": "avocado", "strategy": "fusion"}``.
        recording: settings of `digs_warp.sim.config.SimulateConfig` that differ from the default.
        reconstruction: dotted settings of `digs_warp.pipeline.reconstruct.ReconstructConfig` that differ.
        effort: how long it takes, relative to the other cases of its study: a guess, for the time budget.
        threads: CPU threads; None: as the runner has them.
        finishes: also measure what can be chosen after the training (`engine.finish`).
    """

    labels: Mapping[str, Any]
    recording: Mapping[str, Any] = field(default_factory=dict)
    reconstruction: Mapping[str, Any] = field(default_factory=dict)
    effort: float = 1.0
    threads: int | None = None
    finishes: bool = False

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


def plain(value: Any) -> Any:
    """Return a value of dataclasses, paths and NumPy scalars as JSON holds it."""
    return json.loads(to_json(value))


def digest(value: Any) -> str:
    """Return 16 hexadecimal digits that identify a JSON-like value; the order of keys does not matter."""
    text = json.dumps(plain(value), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
