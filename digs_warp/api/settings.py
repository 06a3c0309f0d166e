"""Keywords -> settings and folders: names, defaults and rules are those of the command line's flags."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

from digs_warp.checks import DigsError
from digs_warp.commands.output import OutputFolder
from digs_warp.commands.settings_file import alternatives, setting_names, settings_of
from digs_warp.record.layout import RUN_RECORD
from digs_warp.record.replacement import check_place
from digs_warp.words import did_you_mean

T = TypeVar("T")


@contextmanager
def opened_folder(
    out: Path | str,
    resume: bool,
    overwrite: bool,
    inputs: Sequence[Path | None],
    writes: Sequence[str],
) -> Iterator[Path]:
    """Yield the folder to write results into; `OutputFolder` says more.

    Args:
        out: the folder of the results.
        resume: go on in it.
        overwrite: replace what an earlier run left there at the end of the block.
        inputs: what is read.
        writes: the names that results may have, as patterns.

    Raises:
        DigsError: the folder holds results, or files with such names that no run wrote.
    """
    out = Path(out)
    if overwrite:
        with OutputFolder(out=out, resume=resume, overwrite=True).opened(inputs, writes) as folder:
            yield folder
        return
    if not resume and (out / RUN_RECORD).exists():
        raise DigsError(
            f"'{out}': the folder already holds results; go on with resume=True if they are of a run that "
            "was cut off, replace them with overwrite=True, or choose another folder"
        )
    if not resume:
        check_place(out, writes)
    yield out


def with_settings(options: T, settings: Mapping[str, Any]) -> T:
    """Return options with some settings changed, also those of options within.

    Args:
        options: a dataclass as a command of `digs_warp.commands` takes it.
        settings: by name of the flag, with underscores: ``time_budget=60.0`` is ``--time-budget 60s``.

    Raises:
        DigsError: a name that is no setting, a choice that does not exist, or a value out of range.
    """
    names = sorted(setting_names(type(options)))
    for name in settings:
        if name not in names:
            raise DigsError(f"{name}: no such setting{did_you_mean(name, names)}")
    return _changed(options, settings)


def _changed(options: T, settings: Mapping[str, Any]) -> T:
    changes: dict[str, Any] = {}
    for name, field, hint in settings_of(type(options)):
        value = getattr(options, field)
        if is_dataclass(value):
            changes[field] = _changed(value, settings)
        elif name in settings:
            changes[field] = _checked(name, settings[name], hint)
    return replace(options, **changes)  # pyright: ignore[reportArgumentType]


def _checked(name: str, value: Any, hint: Any) -> Any:
    kinds = alternatives(hint)
    choices = [choice for kind in kinds if get_origin(kind) is Literal for choice in get_args(kind)]
    if choices and value not in (*choices, *((None,) if type(None) in kinds else ())):
        raise DigsError(f"{name}: {value!r}, expected one of {', '.join(map(str, choices))}")
    return Path(value) if isinstance(value, str) and Path in kinds else value
