"""What a command is, and how commands are grouped."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeAlias

from digs_warp.settings import Settings


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


@dataclass(frozen=True)
class Preset:
    """A command with its own name and defaults, such as `bench raster`.

    Attributes:
        command: holds the defaults; a required flag is `tyro.MISSING`.
        about: what it does, for the help.
    """

    command: Command
    about: str


@dataclass(frozen=True)
class Group:
    """Commands that share a first word, such as `usd info` and `usd diff`.

    Attributes:
        about: what they do, for the help.
        members: in the order in which the help lists them.
    """

    about: str
    members: Mapping[str, "Node"]


Node: TypeAlias = type[Command] | Preset | Group
