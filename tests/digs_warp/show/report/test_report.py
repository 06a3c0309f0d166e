"""The report: complete, self-contained, honest numbers, from its command, too; and folders that give none."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.commands.parse import CommonFlags, read_command
from digs_warp.commands.run import Run
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.images import read_image, write_image
from digs_warp.data.layers import Layer
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.run_log import RunLog, RunRecord
from digs_warp.show.report.capture_section import capture_section
from digs_warp.show.report.page import write_report
from digs_warp.show.report.run_section import RunRecords
from reference.report_folder import (
    HEIGHT,
    TEST_EVERY,
    WIDTH,
    Page,
    decoded,
    report_on,
    write_and_parse,
)


def test_the_page_holds_everything_itself(run: tuple[Capture, Path, Path], tmp_path: Path) -> None:
    page = write_and_parse(run)
    text = run[2].read_text(encoding="utf-8")
    assert all(link.startswith(("data:", "#")) for link in page.links)
    assert "@import" not in text
    assert not re.search(r"url\((?!#)", text)
    for call in ("fetch(", "XMLHttpRequest", "WebSocket", "sendBeacon", "import(", "EventSource"):
        assert call not in text
    for image in page.images:
        assert image["alt"]
        pixels = decoded(image, tmp_path)
        assert pixels.shape == (int(str(image["height"])), int(str(image["width"])), 3)


def test_key_numbers_times_and_settings_are_there_once(run: tuple[Capture, Path, Path]) -> None:
    path = run[1] / "run.json"
    record = json.loads(path.read_text())
    sizes = {"views": 8, "trained": 30.65, "half": 27.12, "four_thirds": None, "double": 28.85}
    record["results"]["scores"]["other_sizes"] = sizes
    path.write_text(json.dumps(record))
    page = write_and_parse(run)
    figures = (
        "34.50 dB",
        "1.25 mm",
        "1.55 mm",
        "2.50 mm",
        "1,234",
        "4 iterations",
        "-1.8, -3.5 dB",
    )
    for figure in (*figures, "from 987 points"):
        assert page.text.count(figure) == 1, figure
    assert not any(other in page.text for other in ("20.25", "0.8125"))  # the frame, mostly white
    for expected in (
        *("simulation: render", "9.5", "reconstruction: train", "20.2", "export", "32.5 s"),
        *(
            "digs-warp run --out again --tier law --voxel-size 0.004",
            "init.voxel_size",
            "warp-lang",
        ),
    ):
        assert expected in page.text, expected
    # Each figure leads to what it means.
    text = run[2].read_text(encoding="utf-8")
    terms = re.findall(r'<div class=card><a href="#(\w+)">', text)
    assert len(terms) == len({*terms}) == 8
    assert all(f"<dt id={term}>" in text for term in terms)


def test_contact_sheet_shows_every_kind_of_image_of_six_frames(
    run: tuple[Capture, Path, Path],
) -> None:
    page = write_and_parse(run)
    shown = [str(image["alt"]) for image in page.images]
    for kind in ("left", "right", "true depth", "sensed depth", "sensed minus", "object mask"):
        assert sum(bool(re.match(rf"Frame \d+: {kind}", alt)) for alt in shown) == 6, kind
    assert "depth [m]" in page.text and "sensed minus true depth [mm]" in page.text


def test_depth_that_is_too_far_is_red(run: tuple[Capture, Path, Path], tmp_path: Path) -> None:
    far = [f.with_layer(Layer.DEPTH, f.load_depth_true() + 0.01) for f in run[0].frames]
    page = Page(capture_section(replace(run[0], frames=tuple(far))))
    (first, *_) = (i for i in page.images if "sensed minus true" in str(i["alt"]))
    red, _, blue = decoded(first, tmp_path)[10:22, 18:30].astype(int).reshape(-1, 3).T
    assert (red > blue + 50).all()


def test_causes_are_shown(run: tuple[Capture, Path, Path]) -> None:
    before = write_and_parse(run)
    capture = run[0]
    cause = np.zeros((HEIGHT, WIDTH), np.uint8)
    cause[:, : WIDTH // 4] = 2
    for frame in capture.frames:
        write_image(capture.folder / f"cause/{frame.name}.png", cause)
    index = json.loads((capture.folder / "transforms.json").read_text())
    for number, entry in enumerate(index["frames"]):
        entry["cause_file_path"] = f"cause/{number:04d}.png"
    index["digs_warp"]["cause_labels"] = {"0": "ok", "2": "occluded"}
    (capture.folder / "transforms.json").write_text(json.dumps(index))
    page = write_and_parse((read_capture(capture.folder), *run[1:]))
    assert "occluded 25.0%: hidden from the right eye" in page.text and "ok 75.0%" in page.text
    assert len(page.images) == len(before.images) + 6 + 2  # a column, two swatches


def test_findings_about_the_capture_are_shown(run: tuple[Capture, Path, Path]) -> None:
    assert "Warning:" not in write_and_parse(run).text
    record = json.loads((run[1] / "run.json").read_text())
    record["results"]["poses"] = {"findings": ["The depth is <odd>."]}
    record["results"]["verdict"] = {"good": False, "words": "poor, because of <holes>"}
    (run[1] / "run.json").write_text(json.dumps(record))
    text = write_and_parse(run).text
    assert re.search(r"Warning:\s+The depth is <odd>\.", text)
    assert (
        re.search(r"Poor\s*, because of <holes>", text) and "1 warning about the recording" in text
    )


def test_six_views_are_shown_from_worst_to_best_beside_the_truth(
    run: tuple[Capture, Path, Path], tmp_path: Path
) -> None:
    path = run[1] / "renders/0001.png"
    pixels = read_image(path)
    pixels[10:16, 26:30] ^= 0x80
    write_image(path, pixels)
    page = write_and_parse(run)
    shown = [image for image in page.images if str(image["alt"]).startswith("View")]
    names = [str(image["alt"]).split(": ")[0].removeprefix("View ") for image in shown]
    assert names[::3] == names[1::3] == names[2::3]
    # PSNR ascends with the frame in this folder: 10 views, ranks 0, 2, 4, 5, 7, 9.
    # Three of the six are in sight, the others fold away.
    assert names[::3] == ["0001", "0011", "0019", "0005", "0009", "0015"]
    # The disc of 19 px in the middle, in a square with a margin: rows 4 to 28, columns 12 to 36.
    truth, rendered, difference = (decoded(image, tmp_path).astype(int) for image in shown[:3])
    assert truth.shape == (25, 25, 3) and (truth[:2] > 200).all()
    wrong = np.zeros((25, 25), bool)
    wrong[6:12, 14:18] = True
    assert (np.abs(truth - rendered).max(axis=2)[wrong] > 60).all()
    assert (difference.min(axis=2)[7:11, 15:17] > 100).all()
    assert (difference[:, :12] < 60).all()
    for frame in run[0].split(TEST_EVERY)[1]:
        assert frame.name in page.text


def test_text_from_files_is_escaped(run: tuple[Capture, Path, Path]) -> None:
    evil = "<script>alert('x')</script>&$x_2$"
    record: dict[str, Any] = {evil: evil, "nested": {evil: 1}}
    RunLog("reconstruct", record, {evil: 1.0}).save(run[1] / "run.json")
    RunLog("simulate", {"mesh": f"/x/{evil.replace('/', '')}.glb"}).save(run[0].folder / "run.json")
    page = write_and_parse(run)
    assert not any("alert" in script for script in page.scripts)
    assert page.text.count("alert('x')") >= 5
    assert f"--{evil}" not in page.text  # nor is a setting of another version in the command


def test_what_is_not_known_shows_as_a_dash_or_is_said(run: tuple[Capture, Path, Path]) -> None:
    evaluation = json.loads((run[1] / "evaluation.json").read_text())
    evaluation["mean"]["psnr_object"] = None  # infinite: JSON has no number for it
    evaluation["views"][3]["psnr_object"] = None
    (run[1] / "evaluation.json").write_text(json.dumps(evaluation))
    (run[1] / "initial_points.npz").unlink()
    assert "from – points" in write_and_parse(run).text  # noqa: RUF001
    (run[1] / "evaluation.json").write_text('{"views": [], "mean": {}}')
    (run[1] / "training.jsonl").write_text("")
    # A record beside the report that is not of the whole run is not counted twice.
    text = write_and_parse((run[0], run[1], run[1] / "report.html")).text
    for words in ("No view was held out.", "too few records", "31.2 s in all"):
        assert words in text


def test_a_report_of_a_scene_in_color_names_no_object(run: tuple[Capture, Path, Path]) -> None:
    capture, folder, page = run
    record = json.loads((folder / "run.json").read_text())
    record["results"]["poses"] = {"subject": "scene"}
    (folder / "run.json").write_text(json.dumps(record))
    index = json.loads((capture.folder / "transforms.json").read_text())
    for frame in index["frames"]:
        for key in ("depth_file_path", "depth_true_file_path", "mask_path", "right_file_path"):
            del frame[key]
    (capture.folder / "transforms.json").write_text(json.dumps(index))
    found = write_and_parse((read_capture(capture.folder), folder, page))
    for wrong in ("on the object", "the object is shown", "34.50 dB", "depth [m]"):
        assert wrong not in found.text, wrong
    for right in ("of everything in view", "20.25 dB"):
        assert right in found.text, right
    frames = [str(i["alt"]) for i in found.images if str(i["alt"]).startswith("Frame")]
    assert {alt.split(": ")[1] for alt in frames} == {"left image"}


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
