"""What captures at rising noise are made of: a simulated walk, or a recording of the user's own."""

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

from digs_warp.record.files import to_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate
from digs_warp.sim.record.session import Session, prepare_session
from digs_warp.sim.scene.mesh.read import mesh_files
from digs_warp.sim.testing.recording import OwnRecording, content_of, write_noisy

KEY_LENGTH = 20  # hexadecimal digits


class NoiseSource(Protocol):
    """Makes a capture at any strength of the sensor's errors."""

    def key(self, strength: float) -> str:
        """Return a name for all that decides the bytes of the capture, but for code."""
        ...

    def write(self, strength: float, folder: Path) -> None:
        """Write the capture, or go on where a run was cut off; the result is the same."""
        ...


@dataclass(frozen=True, eq=False)
class SimulatedWalk:
    """A simulated recording.

    Attributes:
        config: of the recording at strength 1.
    """

    config: SimulateConfig

    def key(self, strength: float) -> str:
        """Hash the settings, the files they name, and those that these name."""
        config = self._at(strength)
        digest = hashlib.sha256(to_json(config).encode())
        for path in self._files:
            digest.update(hashlib.sha256(path.read_bytes()).digest())
        return digest.hexdigest()[:KEY_LENGTH]

    def write(self, strength: float, folder: Path) -> None:
        """Simulate; see `NoiseSource.write`."""
        simulate(self._at(strength), folder, resume=True, session=self._session)

    @property
    def _files(self) -> list[Path]:
        profile = None if self.config.profile is None else Path(self.config.profile)
        named = [path for path in (*self.config.input_files, profile) if path and path.is_file()]
        return [file for path in named for file in mesh_files(path)]

    def _at(self, strength: float) -> SimulateConfig:
        return replace(self.config, strength=float(strength))

    @cached_property
    def _session(self) -> Session:
        """Scene, light and walk: the same at every strength, and slow to load."""
        return prepare_session(self.config, load_inputs(self.config))


@dataclass(frozen=True, eq=False)
class WorseRecording:
    """A recording of the user's own, with errors added to it.

    Attributes:
        recording: as it is at strength 0.
    """

    recording: OwnRecording

    def key(self, strength: float) -> str:
        """Hash the settings, the camera and the content of the recording."""
        own = self.recording
        settings = (sorted(own.effects), own.seed, own.figures, float(strength))
        digest = hashlib.sha256(repr(settings).encode() + self._content.encode())
        return digest.hexdigest()[:KEY_LENGTH]

    def write(self, strength: float, folder: Path) -> None:
        """Add the errors; see `NoiseSource.write`."""
        write_noisy(self.recording, strength, folder)

    @cached_property
    def _content(self) -> str:
        return content_of(self.recording.capture)
