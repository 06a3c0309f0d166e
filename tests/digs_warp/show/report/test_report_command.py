"""`digs-warp report`: the page of a stored run, the command in it, and folders that give no page."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.commands.parse import CommonFlags, read_command
from digs_warp.commands.run import Run
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.run_log import RunLog, RunRecord
from digs_warp.show.report.page import write_report
from digs_warp.show.report.run_section import RunRecords
from reference.report_folder import report_on

Stored = tuple[Capture, Path, Path]


def test_the_page_is_that_of_the_run_and_is_not_replaced(run: Stored, capsys) -> None:
    _, folder, page = run
    report_on(run)
    again = page.with_name("again.html")
    assert main(["report", str(folder.parent), "--out", str(again)]) == EXIT_OK
    assert again.read_bytes() == page.read_bytes()
    assert main(["report", str(folder)]) == EXIT_OK
    assert f"{folder / 'report.html'}: " in capsys.readouterr().out
    assert main(["report", str(folder)]) != EXIT_OK
    assert "add --overwrite" in capsys.readouterr().err
    assert main(["report", str(folder), "--overwrite"]) == EXIT_OK


def test_a_recording_that_has_moved_is_asked_for(run: Stored, tmp_path: Path, capsys) -> None:
    capture, folder, _ = run
    alone = tmp_path / "elsewhere/reconstruction"
    shutil.copytree(folder, alone)
    shutil.move(capture.folder, tmp_path / "moved")
    assert main(["report", str(alone)]) == EXIT_BAD_INPUT
    assert "name it with --capture" in capsys.readouterr().err
    assert not (alone / "report.html").exists()
    assert main(["report", str(alone), "--capture", str(tmp_path / "moved")]) == EXIT_OK


FLAGS = {
    "nothing": "",
    "numbers, words": "--frames 16 --width 320 --iterations 9 --tier law --subject scene --density adaptive",
    "lists and switches": "--elevations 10 35.5 --seed 7 --keep-course --scene a.glb b.obj",
}


def records_of(run: Run) -> RunRecords:
    reconstruction = run.reconstruct_config(run.recording.seed)
    simulated = RunLog("simulate", run.recording).record()
    return RunRecords(
        simulated,
        RunLog("reconstruct", reconstruction).record(),
        RunRecord("run", {}, {}),
        "capture",
    )


@pytest.mark.parametrize("flags", FLAGS.values(), ids=FLAGS)
def test_the_command_does_the_same_again(flags: str) -> None:
    run = read_command(["run", "--out", "again", *flags.split()], CommonFlags())
    assert isinstance(run, Run)
    ((program, *words),) = records_of(run).commands()
    assert program == "digs-warp"
    assert read_command(words, CommonFlags()) == run
    assert len(words) <= 3 + len(flags.split())


def test_what_has_no_flag_comes_from_the_record() -> None:
    run = read_command(["run", "--out", "again"], CommonFlags())
    assert isinstance(run, Run)
    init = replace(run.init, edge_filter=False)
    ((*_, flag, file),) = records_of(replace(run, init=init)).commands()
    assert (flag, file) == ("--config", "run.json")


NEEDED = ["evaluation.json", "training.jsonl", "gaussians.npz", "run.json"]


@pytest.mark.parametrize("name", [*NEEDED, "initial_points.npz"])
def test_a_missing_or_truncated_file_is_named(run: Stored, name: str) -> None:
    path = run[1] / name
    path.write_bytes(path.read_bytes()[:-10])
    for _ in range(1 + (name in NEEDED)):
        with pytest.raises(DigsError, match=re.escape(name)):
            report_on(run)
        assert not run[2].exists()
        path.unlink(missing_ok=True)


def test_an_evaluation_of_another_form_is_named(run: Stored) -> None:
    for content in ("{}", '{"views": [], "mean": 3}', '{"views": [{}], "mean": {}}'):
        (run[1] / "evaluation.json").write_text(content)
        with pytest.raises(DigsError, match=r"evaluation '.*evaluation\.json'"):
            report_on(run)


def test_another_capture_or_other_renders_are_refused(run: Stored) -> None:
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


def test_what_is_only_in_memory_has_no_report(run: Stored) -> None:
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
