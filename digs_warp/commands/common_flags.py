"""The flags that every command has."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

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

    By hand: tyro would read the source of this file for its help, a tenth of the time of ``--help``.

    Raises:
        DigsError: --config without a file, or flags that contradict each other.
    """
    end = arguments.index("--") if "--" in arguments else len(arguments)
    switches = {f"--{each.name.replace('_', '-')}": each.name for each in fields(CommonFlags)}
    values: dict[str, Any] = {}
    words: list[str] = []
    rest = iter(arguments[:end])
    for word in rest:
        flag, is_joined, value = word.partition("=")
        flag = flag.replace("_", "-")
        if flag == "--config":
            value = value if is_joined else next(rest, "")
            if not value or value.startswith("-"):
                raise DigsError("--config needs a file, such as the run.json of an earlier run")
            values["config"] = Path(value)
        elif flag in switches and not is_joined:
            values[switches[flag]] = True
        else:
            words.append(word)
    return CommonFlags(**values), [*words, *arguments[end:]]
