"""JSON-like metadata <-> dictionaries of a USD layer.

Booleans, numbers, text, dictionaries and lists of fractions are stored as they are. Other lists, None and
huge integers become JSON text after ``json:`` and come back as they were.
"""

import json
import logging
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import MOST_DILATION, NO_FILTER, ScreenFilter
from digs_warp.record.fields import Fields, parse_json
from digs_warp.record.files import to_json

logger = logging.getLogger(__name__)

JSON_MARK = "json:"

_KERNEL, _DILATION, _ANTIALIAS = "kernel", "dilation_px2", "antialias"


def with_filter(metadata: dict[str, Any], screen_filter: ScreenFilter, what: str) -> dict[str, Any]:
    """Return metadata that also says what the splats of ``what`` are drawn with, if it is anything.

    USD has no attribute for it, and its renderers add nothing: a warning says so.
    """
    if screen_filter == NO_FILTER:
        return metadata
    logger.warning(
        "%s: these splats are for viewers that widen them by %g px^2 on the screen. Renderers of USD do not, "
        "and show them thinner; what 'digs-warp reconstruct' makes today looks the same in both",
        *(what, screen_filter.dilation),
    )
    kernel = metadata.get(_KERNEL, {}) | filter_metadata(screen_filter)
    return metadata | {_KERNEL: kernel}


def filter_metadata(screen_filter: ScreenFilter) -> dict[str, Any]:
    """Return what the kernel's entry in the metadata says about the filter."""
    said: dict[str, Any] = {_DILATION: screen_filter.dilation}
    return said | {_ANTIALIAS: True} if screen_filter.antialias else said


def filter_of(metadata: dict[str, Any], what: str) -> ScreenFilter:
    """Return what splats are drawn with, by the metadata of their scene.

    Raises:
        UsdError: the entry has another form.
    """
    kernel = Fields(metadata, what, UsdError).section(_KERNEL, optional=True)
    dilation = kernel.number(_DILATION, 0, MOST_DILATION, 0.0, f"0 to {MOST_DILATION:g} px^2")
    return ScreenFilter(dilation, kernel.flag(_ANTIALIAS, False))


def portable_json(metadata: dict[str, Any]) -> dict[str, Any]:
    """Return ``metadata`` in plain JSON types; dataclasses, paths and NumPy values are allowed.

    Of absolute paths only the last part is kept: a scene is copied to other machines, its folders are not.

    Raises:
        UsdError: a value has no JSON form, or a number is NaN or infinite.
    """
    try:
        plain = json.loads(to_json(metadata))
    except (TypeError, ValueError) as error:
        raise UsdError(f"metadata of a USD scene: {error}; expected JSON-like values") from error
    return {key: _portable(value) for key, value in plain.items()}


def usd_from_json(plain: dict[str, Any]) -> dict[str, Any]:
    """Return a dictionary that USD can hold, from the plain JSON types of `portable_json`."""
    return {key: _to_usd(value) for key, value in plain.items()}


def json_from_usd(metadata: dict[str, Any]) -> dict[str, Any]:
    """Return the input of `usd_from_json`, in plain Python types."""
    return {str(key): _to_json(value) for key, value in metadata.items()}


def _portable(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _portable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_portable(item) for item in value]
    if isinstance(value, str):
        value = value.encode("utf-8", "backslashreplace").decode()  # a file's name may be no text
        for path in (PurePosixPath(value), PureWindowsPath(value)):
            if path.is_absolute():
                return path.name
    return value


def _to_usd(value: Any) -> Any:
    from pxr import Vt

    if isinstance(value, dict):
        return usd_from_json(value)
    if isinstance(value, list) and {type(item) for item in value} == {float}:
        return Vt.DoubleArray(value)
    if isinstance(value, bool | str | float) or (isinstance(value, int) and _fits_int64(value)):
        return value
    return JSON_MARK + json.dumps(value)


def _fits_int64(value: int) -> bool:
    return -(2**63) <= value < 2**63


def _to_json(value: Any) -> Any:
    if isinstance(value, dict):
        return json_from_usd(value)
    if isinstance(value, str) and value.startswith(JSON_MARK):
        try:
            return parse_json(value.removeprefix(JSON_MARK))
        except ValueError:
            return value
    if isinstance(value, bool | int | float | str):
        return value
    if hasattr(value, "__len__"):  # an array, ours or another program's
        return [_to_json(item) for item in value]
    return str(value)  # a type of USD that JSON does not know, such as an asset path
