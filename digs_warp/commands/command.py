"""What a command is, how commands are grouped, and which there are."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeAlias

import tyro

from digs_warp.settings import Settings

if TYPE_CHECKING:
    from digs_warp.data.capture import Capture
    from digs_warp.pipeline.reconstruction import Reconstruction


class Command(Settings):
    """A command of `digs-warp`. Subclasses are frozen dataclasses; their fields are its flags."""

    # Whether an interrupted command can go on where it stopped.
    can_resume: ClassVar[bool] = False

    def execute(self) -> str:
        """Do the work and return what to print at the end."""
        raise NotImplementedError


class SettingsCommand(Command):
    """A command with many settings: --help shows only the main ones, and a file can supply them."""

    # The flags that --help shows, with underscores; --help-all shows the rest, too.
    main_flags: ClassVar[tuple[str, ...]]

    # The command in whose run.json its settings are, and the dataclass of those.
    recorded_as: ClassVar[str]
    recorded: ClassVar[type]

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Return the command with the settings of a run.json; required flags are `tyro.MISSING`."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class SplatOptions:
    """What splat files do not say themselves."""

    up: Literal["z", "y", "-y"] = "z"
    """The axis that points up in PLY, SOG and .splat files, which do not say it. z: as this program writes
    them; -y: most scenes that other programs trained; y: Y-up programs. SPZ, glTF and USD need no telling."""

    drop_broken: tyro.conf.FlagCreatePairsOff[bool] = False
    """Leave out Gaussians with NaN or infinite values instead of refusing the file of another program."""

    prim: str | None = None
    """Path of the splats in a USD scene that shows several fields of them, such as /Asset/Gaussians."""

    def read(self, source: Path, capture: "Capture | None" = None) -> "Reconstruction":
        """Read the Gaussians of a file or folder; see `digs_warp.pipeline.scene_files.read_scene`."""
        from digs_warp.pipeline.scene_files import read_scene

        return read_scene(source, self.up, self.drop_broken, capture, self.prim)


@dataclass(frozen=True)
class Group:
    """Commands that share a first word, such as `study run` and `study list`.

    Attributes:
        about: what they do, for the help.
        members: in the order in which the help lists them.
    """

    about: str
    members: Mapping[str, "Node"]


Node: TypeAlias = type[Command] | Group


class Places(Mapping[str, Node]):
    """Commands by name, each imported when it is asked for: one command starts without the others.

    Args:
        places: by name, "module.NAME" in this folder.
    """

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = places

    def __getitem__(self, name: str) -> Node:
        module, _, kind = self._places[name].partition(".")
        return getattr(import_module(f"digs_warp.commands.{module}"), kind)

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def about(self, name: str) -> str:
        """Return the first paragraph on a command, read from its file: importing all takes a second."""
        module, _, kind = self._places[name].partition(".")
        text = Path(__file__).with_name(f"{module}.py").read_text(encoding="utf-8")
        begin = rf'^(?:class {kind}\b[^"]*""|{kind} = Group\(\s*)"'
        found = re.search(rf'{begin}(.*?)(?:"|\n\n)', text, re.DOTALL | re.MULTILINE)
        return " ".join(found[1].split()) if found else ""

    def __len__(self) -> int:
        return len(self._places)


COMMANDS = Group(
    """Simulate a handheld stereo depth camera, reconstruct what it recorded as
Gaussian splats, and write them as a USD scene.

Start with 'digs-warp run --out out/demo'. It needs no input, takes a few minutes
and ends by saying where the results are.

Every command explains its flags with --help. --quiet shows no progress, --verbose logs
details, --version prints the version.""",
    Places(
        {
            "run": "run.Run",
            "plan": "plan.Plan",
            "simulate": "simulate.Simulate",
            "check": "check.Check",
            "reconstruct": "reconstruct.Reconstruct",
            "export-usd": "usd.ExportUsd",
            "convert": "convert.Convert",
            "edit": "edit.Edit",
            "view": "view.View",
            "report": "report.Report",
            "render": "render.Render",
            "mesh": "mesh.Mesh",
            "info": "info.Info",
            "usd": "usd.USD",
            "sensor": "sensor.SENSOR",
            "study": "study.STUDY",
            "precompile": "precompile.Precompile",
        }
    ),
)
