"""A whole scene has no object: summaries and report say what was measured instead."""

import json
from pathlib import Path

import pytest

from digs_warp.data.capture import Capture, read_capture
from reference.report_folder import write_and_parse


@pytest.fixture
def scene(run: tuple[Capture, Path, Path]) -> tuple[Capture, Path, Path]:
    capture, folder, page = run
    record = json.loads((folder / "run.json").read_text())
    record["results"]["poses"] = {"subject": "scene"}
    (folder / "run.json").write_text(json.dumps(record))
    index = json.loads((capture.folder / "transforms.json").read_text())
    for frame in index["frames"]:
        del frame["mask_path"]
    (capture.folder / "transforms.json").write_text(json.dumps(index))
    return read_capture(capture.folder), folder, page


def test_a_report_of_a_scene_names_no_object(scene: tuple[Capture, Path, Path]) -> None:
    text = write_and_parse(scene).text
    for wrong in ("on the object", "the object is shown", "34.50 dB"):
        assert wrong not in text, wrong
    for right in ("of everything in view", "20.25 dB"):
        assert right in text, right
