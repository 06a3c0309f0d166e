"""The formats that a capture can be exported to, by name."""

from collections.abc import Callable
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.interchange.bop import write_bop
from digs_warp.interchange.colmap import write_colmap_binary, write_colmap_text
from digs_warp.interchange.redwood import write_redwood
from digs_warp.interchange.tum import write_tum

EXPORTERS: dict[str, Callable[[Capture, Path], None]] = {
    "colmap": write_colmap_text,
    "colmap-binary": write_colmap_binary,
    "tum": write_tum,
    "bop": write_bop,
    "redwood": write_redwood,
}


def export_capture(capture: Capture, form: str, folder: Path) -> None:
    """Write ``capture`` below ``folder`` in the format ``form``, one of `EXPORTERS`.

    Raises:
        DigsError: an unknown format, or a capture that lacks what the format needs.
    """
    if form not in EXPORTERS:
        raise DigsError(f"export format '{form}': expected one of {', '.join(EXPORTERS)}")
    EXPORTERS[form](capture, Path(folder))
