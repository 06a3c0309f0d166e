"""A whole scene has no object: summaries and report say what was measured instead."""

import json
from pathlib import Path

import pytest

from digs_warp.commands.reconstruction_options import reconstruction_words
from digs_warp.data.capture import Capture, read_capture
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.facts import describe
from reference.report_folder import write_and_parse

ON_OBJECT = (
    "PSNR 34.50 dB and SSIM 0.9000 on the object in 10 held-out views (20.25 dB over the frame)"
)
OF_FRAME = "PSNR 20.25 dB and SSIM 0.8125 over the frame in 10 held-out views"


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
    for wrong in ("on the object", "PSNR, object", "the object is shown", "34.50 dB"):
        assert wrong not in text, wrong
    for right in ("of everything in view", "20.25 dB", "PSNR, frame [dB]"):
        assert right in text, right


def test_summaries_say_what_was_measured(scene: tuple[Capture, Path, Path]) -> None:
    capture, folder, _ = scene
    result = Reconstruction.load(folder, capture)
    assert OF_FRAME in reconstruction_words(result, len(capture))
    assert describe(folder)["quality"] == OF_FRAME


def test_summaries_of_an_object_are_about_the_object(run: tuple[Capture, Path, Path]) -> None:
    assert describe(run[1])["quality"] == ON_OBJECT
