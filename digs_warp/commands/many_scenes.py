"""Flags for recording many scenes at once."""

import glob
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from digs_warp.checks import DigsError
from digs_warp.settings import Range, Settings


@dataclass(frozen=True, kw_only=True)
class ManyScenes(Settings):
    """Record many scenes into one folder: every mesh in every environment, or scenes drawn at random."""

    meshes: str | None = None
    """Pattern for mesh files, in quotes, for example 'meshes/**/*.glb'."""

    environments: str | None = None
    """Pattern for environment files, in quotes, for example 'skies/*.hdr'."""

    trajectories: Annotated[int, Range(1, 10_000)] = 1
    """Camera paths per object and environment, each with its own seed."""

    scenes: Annotated[int | None, Range(1, 100_000)] = None
    """Number of scenes drawn at random: of --meshes and --environments one for each scene, the rest as
    --randomize says. Scene i depends on --seed and i alone."""

    randomize: str | None = None
    """What is drawn for --scenes, and from which distributions: indoor, tabletop, wild, or a YAML file
    (docs/randomization.md has all keys). A flag that differs from its default stays as given. Default:
    indoor."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.randomize is not None and self.scenes is None:
            raise DigsError(f"--randomize {self.randomize}: how many scenes? Give --scenes, too")
        if self.scenes is not None and self.trajectories != 1:
            raise DigsError(
                "--scenes and --trajectories contradict each other; give one of them. Every scene already "
                "has another camera path"
            )

    @property
    def asked_for(self) -> bool:
        """Whether any of the flags was given."""
        return self != ManyScenes()

    def find(self) -> tuple[list[Path], list[Path]]:
        """Return the mesh and environment files, sorted.

        Raises:
            DigsError: a pattern that no file matches.
        """
        return _matches("meshes", self.meshes), _matches("environments", self.environments)


def _matches(flag: str, pattern: str | None) -> list[Path]:
    if pattern is None:
        return []
    paths = [Path(name) for name in sorted(glob.glob(pattern, recursive=True))]
    files = [path for path in paths if path.is_file()]
    if not files:
        raise DigsError(f"--{flag} '{pattern}': no file matches; put the pattern in quotes")
    return files
