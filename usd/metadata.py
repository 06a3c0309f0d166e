"""What a scene says of itself: JSON text in the layer's ``customLayerData["digs_warp"]``."""

import json
import logging
from pathlib import PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Any

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import MOST_DILATION, NO_FILTER, ScreenFilter
from digs_warp.record.fields import Fields, parse_json
from digs_warp.record.files import to_json
from digs_warp.usd import names

if TYPE_CHECKING:
    from pxr import Usd

logger = logging.getLogger(__name__)

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
        return _portable(json.loads(to_json(metadata)))
    except (TypeError, ValueError) as error:
        raise UsdError(f"metadata of a USD scene: {error}; expected JSON-like values") from error


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


def read_metadata(stage: "Usd.Stage") -> dict[str, Any]:
    """Return our provenance dictionary of a scene, empty when it has none."""
    text = (stage.GetMetadata("customLayerData") or {}).get(names.METADATA_KEY)
    try:
        found = parse_json(text) if isinstance(text, str) else None
    except ValueError:
        found = None
    return found if isinstance(found, dict) else {}
