"""A recording as other programs write it, for tests of what people hand in."""

import json
from pathlib import Path
from typing import Any

from digs_warp.data.capture import Capture, read_capture
from digs_warp.formats.captures.formats import export_capture
from digs_warp.record.files import to_json
from reference.recorded import converted


def nerfstudio(capture: Capture, folder: Path, **changes: Any) -> dict[str, Any]:
    """The capture as another program's index: PNG images, depth of 16 bits, masks."""
    export_capture(capture, "nerfstudio", folder)
    index = json.loads((folder / "transforms.json").read_text())
    for key in ("train_filenames", "val_filenames", "test_filenames"):
        index.pop(key, None)
    index |= changes
    (folder / "transforms.json").write_text(to_json(index))
    return index


def save(folder: Path, index: dict[str, Any], name: str = "transforms.json") -> None:
    (folder / name).write_text(json.dumps(index))


FORMS = ["nerfstudio", "tum", "redwood", "bop", "as it is"]


def handed_in(capture: Capture, form: str, folder: Path) -> tuple[str, Path]:
    """Export it; the folder is read as another program's, or as a capture "as it is"."""
    kind = "nerfstudio" if form == "as it is" else form
    export_capture(capture, kind, folder / "r")
    return kind, folder / "r"


def read(form: str, folder: Path, target: Path) -> Capture:
    return read_capture(folder) if form == "as it is" else converted(form, folder, target)
