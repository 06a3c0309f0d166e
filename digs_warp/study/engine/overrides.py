"""Settings of a case: nested frozen records, changed by dotted names."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from digs_warp.checks import DigsError

T = TypeVar("T")


def with_settings(config: T, changes: Mapping[str, Any]) -> T:
    """Return ``config`` with some settings changed; it checks its values as when it was made.

    Args:
        config: a frozen dataclass; its fields may be such records, too.
        changes: dotted name -> value, for example ``{"init.voxel_size": 0.01, "test_every": 6}``.

    Raises:
        DigsError: a name that the record does not have, or a value that it refuses.
    """
    # All changes of one record at once: settings are checked together, and one alone may be refused.
    here: dict[str, Any] = {}
    below: dict[str, dict[str, Any]] = {}
    for name, value in changes.items():
        head, _, rest = name.partition(".")
        if rest:
            below.setdefault(head, {})[rest] = value
        else:
            here[head] = value
    for head, nested in below.items():
        here[head] = with_settings(_field(config, head, is_record=True), nested)
    for head in here:
        _field(config, head)
    return replace(config, **here)  # pyright: ignore[reportArgumentType, reportCallIssue]


def _field(config: Any, name: str, is_record: bool = False) -> Any:
    known = [f.name for f in fields(config)]
    if name not in known:
        raise DigsError(
            f"{type(config).__name__} has no setting '{name}'; there is: {', '.join(known)}"
        )
    value = getattr(config, name)
    if is_record and not is_dataclass(value):
        raise DigsError(f"{type(config).__name__}.{name} is a value, not a group of settings")
    return value
