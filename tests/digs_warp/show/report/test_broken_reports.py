"""Folders from which no report can be made: the error names the file, and no page is left behind."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.page import write_report
from reference.report_folder import report_on

NEEDED = ["evaluation.json", "training.jsonl", "gaussians.npz", "run.json"]


@pytest.mark.parametrize("name", [*NEEDED, "initial_points.npz"])
def test_a_missing_or_truncated_file_is_named(run: tuple[Capture, Path, Path], name: str) -> None:
    path = run[1] / name
    path.write_bytes(path.read_bytes()[:-10])
    for _ in range(1 + (name in NEEDED)):
        with pytest.raises(DigsError, match=re.escape(name)):
            report_on(run)
        assert not run[2].exists()
        path.unlink(missing_ok=True)


def test_an_evaluation_of_another_form_is_named(run: tuple[Capture, Path, Path]) -> None:
    for content in ("{}", '{"views": [], "mean": 3}', '{"views": [{}], "mean": {}}'):
        (run[1] / "evaluation.json").write_text(content)
        with pytest.raises(DigsError, match=r"evaluation '.*evaluation\.json'"):
            report_on(run)


def test_another_capture_or_other_renders_are_refused(run: tuple[Capture, Path, Path]) -> None:
    (run[1] / "renders/0019.png").unlink()
    with pytest.raises(DigsError, match=r"rendered view '.*0019\.png': no such file"):
        report_on(run)
    write_image(run[1] / "renders/0019.png", np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(
        DigsError, match=r"0019\.png': \(8, 8, 3\) of uint8, expected \(32, 48, 3\)"
    ):
        report_on(run)
    evaluation = json.loads((run[1] / "evaluation.json").read_text())
    evaluation["views"][0]["name"] = "../../secret"
    (run[1] / "evaluation.json").write_text(json.dumps(evaluation))
    with pytest.raises(DigsError, match=r"names view '\.\./\.\./secret', which capture"):
        report_on(run)


def test_what_is_only_in_memory_has_no_report(run: tuple[Capture, Path, Path]) -> None:
    capture, folder, page = run
    result = Reconstruction.load(folder, capture)
    for known, found, words in (
        (
            capture,
            replace(result, folder=None),
            r"the reconstruction is only in memory.*reconstruct\(",
        ),
        (replace(capture, stored_in=None), result, r"the recording is only in memory.*simulate\("),
    ):
        with pytest.raises(DigsError, match=words):
            write_report(known, found, page)
    assert not page.exists()
