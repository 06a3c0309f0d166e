"""``--config FILE``: the settings of an earlier run as the defaults of a command."""

from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.commands.command import SettingsCommand
from digs_warp.record.files import read_json, read_yaml


def read_defaults(kind: type[SettingsCommand], path: Path) -> SettingsCommand:
    """Return a command with the settings in a file; its required flags are `tyro.MISSING`.

    Args:
        kind: the command.
        path: a run.json, or JSON or YAML with its "settings" and, if it likes, its "command".

    Raises:
        DigsError: the file cannot be read, or holds settings that are not the command's.
    """
    is_yaml = path.suffix.lower() in (".yaml", ".yml")
    record = (read_yaml if is_yaml else read_json)(path, "--config")
    command = record.get("command", kind.recorded_as)
    if command != kind.recorded_as:
        raise DigsError(
            f"--config '{path}': settings of 'digs-warp {command}'; expected those of "
            f"'digs-warp {kind.recorded_as}'"
        )
    if not isinstance(record.get("settings"), dict):
        raise DigsError(
            f"--config '{path}': no \"settings\" by name in it; expected the form of a run.json"
        )
    try:
        return kind.from_settings(record["settings"])
    except DigsError as error:
        raise DigsError(f"--config '{path}': {error}") from error
