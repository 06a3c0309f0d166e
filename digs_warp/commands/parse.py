"""From words to a command: follows the tree of commands, then lets tyro read the flags."""

import inspect
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, make_dataclass
from pathlib import Path
from typing import Annotated, Any, NoReturn

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import (
    COMMANDS,
    Command,
    Group,
    Node,
    Places,
    SettingsCommand,
)
from digs_warp.commands.flag_rules import FlagRules, RefusedSettings, paragraphs
from digs_warp.commands.settings_file import file_settings, read_defaults, setting_names
from digs_warp.words import counted, did_you_mean, format_facts

PROGRAM = "digs-warp"
HELP = ("-h", "--help")


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


COMMON_FLAGS = tuple(each.name for each in fields(CommonFlags))


def read_command(words: Sequence[str], common: CommonFlags) -> Command:
    """Return the command that ``words`` describe, without running it.

    Raises:
        SystemExit: with code 0 after printing help, with 2 after explaining wrong usage.
        DigsError: an unknown command, or a value out of its range.
    """
    node, path, rest = _follow(words)
    if common.help_all:
        rest = ["--help"]
    program = " ".join([PROGRAM, *path])
    if isinstance(node, Group):
        _show_group(node, program, rest)
    kind, default = node, None
    if common.config is not None:
        if not issubclass(kind, SettingsCommand):
            raise DigsError(f"'{program}' takes no --config; leave it out")
        default = read_defaults(kind, common.config)
    _check_flags(kind, rest, program)
    is_help = any(word in HELP for word in rest)
    shown: tuple[str, ...] = ()
    if is_help and not common.help_all and issubclass(kind, SettingsCommand):
        shown = (*kind.main_flags, *COMMON_FLAGS)
    rules = FlagRules(shown, _useless(kind), describes_groups=is_help)
    line = _line(kind)
    try:
        return tyro.cli(
            line,
            prog=program,
            description=about(node),
            args=rest,
            default=tyro.MISSING_NONPROP if default is None else line(command=default),
            config=(tyro.conf.DisallowNone,),
            registry=rules,
        ).command
    except RefusedSettings as error:
        raise DigsError(str(error)) from error
    except SystemExit as stop:
        if not stop.code and rules.hidden:
            print(f"'{program} --help-all' shows {counted(len(rules.hidden), 'more flag')}.")
        elif not stop.code and issubclass(kind, SettingsCommand):
            more = counted(len(file_settings(kind.recorded)), "more setting")
            print(f"{more} can be set in a file for --config; docs/command-line.md lists them.")
        raise


def about(node: Node) -> str:
    """Return what a command does."""
    return paragraphs(node.about if isinstance(node, Group) else inspect.getdoc(node) or "")


def _follow(words: Sequence[str]) -> tuple[Node, list[str], list[str]]:
    """Return the command or group that the first words name, those words, and the rest."""
    node: Node = COMMANDS
    path: list[str] = []
    for word in words:
        if not isinstance(node, Group) or word.startswith("-"):
            break
        path.append(word)
        if word not in node.members:
            raise DigsError(f"no command '{' '.join(path)}'{did_you_mean(word, node.members)}")
        node = node.members[word]
    return node, path, list(words[len(path) :])


def _show_group(group: Group, program: str, rest: Sequence[str]) -> NoReturn:
    """Print the help of a group when it is asked for, else raise."""
    if not rest:
        raise DigsError(f"'{program}' needs the name of a command: {', '.join(group.members)}")
    if rest[0] not in HELP:
        flags = [f"--{name.replace('_', '-')}" for name in COMMON_FLAGS]
        hint = did_you_mean(rest[0], flags)
        raise DigsError(f"no flag '{rest[0]}' before the name of a command{hint}")
    members = group.members
    listed = (
        {name: members.about(name) for name in members}
        if isinstance(members, Places)
        else {name: about(node).partition("\n")[0] for name, node in members.items()}
    )
    print(f"usage: {program} [-h] COMMAND\n\n{about(group)}\n\n{format_facts(listed)}")
    raise SystemExit(0)


def _check_flags(kind: type[Command], words: Sequence[str], program: str) -> None:
    """Raise a `DigsError` for a flag that the command does not have, with the nearest one that it has."""
    common = [name for name in COMMON_FLAGS if name not in _useless(kind)]
    flags = [f"--{name.replace('_', '-')}" for name in (*setting_names(kind), *common)]
    in_file = file_settings(kind.recorded) if issubclass(kind, SettingsCommand) else {}
    known = {*HELP, *flags, *(flag.replace("--", "--no-", 1) for flag in flags)}
    for word in words[: words.index("--") if "--" in words else None]:
        flag = word.partition("=")[0].replace("_", "-")
        place = in_file.get(re.sub("^--(no-)?", "", flag).replace("-", "_"))
        if place and flag not in known:
            raise DigsError(
                f"'{program}' has no flag '{flag}'; it is the setting {place} in a file for --config"
            )
        if flag.startswith("--") and flag not in known:
            raise DigsError(f"'{program}' has no flag '{word}'{did_you_mean(flag, flags)}")


def _useless(kind: type[Command]) -> tuple[str, ...]:
    """Return the common flags that make no sense for a command."""
    return ("version",) if issubclass(kind, SettingsCommand) else ("version", "config", "help_all")


def _line(kind: type[Command]) -> Any:
    """Return the type of a whole command line: the command and the common flags."""
    command = Annotated[kind, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="")]
    common = Annotated[CommonFlags, tyro.conf.OmitArgPrefixes]
    entries = [("command", command), ("common", common, field(default_factory=CommonFlags))]
    return make_dataclass("Line", entries, kw_only=True)
