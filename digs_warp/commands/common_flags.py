"""The flags that every command has."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from digs_warp.checks import DigsError


@dataclass(frozen=True, kw_only=True)
class CommonFlags:
    """Every command has these flags. They can also come before its name."""

    config: Path | None = None
    """Use the settings in this file as defaults: the run.json of an earlier run, or JSON or YAML of the same
    shape. Flags on the command line override them."""

    quiet: tyro.conf.FlagCreatePairsOff[bool] = False
    """Show no progress and log only errors."""

    verbose: tyro.conf.FlagCreatePairsOff[bool] = False
    """Log details, not only warnings."""

    version: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print the version and exit."""

    help_all: tyro.conf.FlagCreatePairsOff[bool] = False
    """Show the help with all flags and exit."""

    def __post_init__(self) -> None:
        if self.quiet and self.verbose:
            raise DigsError("--quiet and --verbose contradict each other; give one of them")


def take_common_flags(arguments: Sequence[str]) -> tuple[CommonFlags, list[str]]:
    """Return the common flags in a command line, and its other words.

    Raises:
        SystemExit: with code 2 after explaining wrong usage.
        DigsError: flags that contradict each other.
    """
    end = arguments.index("--") if "--" in arguments else len(arguments)
    flags, words = tyro.cli(
        CommonFlags,
        args=arguments[:end],
        return_unknown_args=True,
        add_help=False,
        config=(tyro.conf.DisallowNone,),
    )
    return flags, [*words, *arguments[end:]]
