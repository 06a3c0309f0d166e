"""The report: complete, self-contained, honest numbers, and clear errors for broken folders."""

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.camera import Intrinsics
from digs_warp.capture import Capture, Rig, read_capture
from digs_warp.capture_writer import CaptureWriter, FrameImages
from digs_warp.checks import DigsError
from digs_warp.gaussians import Gaussians
from digs_warp.geometry import look_at
from digs_warp.images import read_image, write_image
from digs_warp.log import RunLog, to_json
from digs_warp.report import write_report
from digs_warp.report.pictures import ColorScale, depth_scale, error_scale, over_white, shrink

WIDTH, HEIGHT, FRAMES, TEST_EVERY = 48, 32, 20, 2
NEEDED = ["evaluation.json", "training.jsonl", "gaussians.npz", "run.json"]
VOID_TAGS = {"meta", "img", "br", "link"}


class Page(HTMLParser):
    """Collects what a page holds, and checks that its tags nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.images: list[dict[str, str | None]] = []
        self.links: list[str] = []
        self.text = ""
        self.scripts = 0
        self._open: list[str] = []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag == "img":
            self.images.append(values)
        self.scripts += tag == "script"
        outside = [values.get(key) for key in ("src", "href", "xlink:href", "action")]
        self.links += [link for link in outside if link]
        if tag not in VOID_TAGS:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID_TAGS:
            self.handle_endtag(tag)

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] != "style":
            self.text += data + " "


def write_capture(folder: Path, full: bool = True) -> Capture:
    """A disc on noise; ``full``: a stereo recording with true depth, else left images and masks only."""
    rng = np.random.default_rng(0)
    writer = CaptureWriter(
        folder, Intrinsics.from_fov(WIDTH, HEIGHT, 60), Rig(0.1) if full else None
    )
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    mask = ((rows - 16) ** 2 + (columns - 24) ** 2 < 100).astype(np.uint8) * 255
    for number in range(FRAMES):
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        depth_true = np.where(mask > 0, 1.0 + 0.01 * rows, 4.0).astype(np.float32)
        depth = depth_true + rng.normal(0, 0.002, depth_true.shape).astype(np.float32)
        depth[:, :5] = np.nan
        extra = {"right": image[:, ::-1], "depth_true": depth_true} if full else {}
        writer.write_frame(number, FrameImages(image, depth, mask, **extra))
        eye = np.array([np.cos(number), np.sin(number), 0.3])
        writer.add_pose(number, look_at(eye, np.zeros(3), np.array([0.0, 0, 1])), number / 4)
    return writer.finish()


def write_reconstruction(folder: Path, capture: Capture) -> None:
    _, test = capture.split(TEST_EVERY)
    views = []
    for rank, frame in enumerate(test):
        truth = over_white(frame.load_image(), frame.load_mask())
        write_image(folder / f"renders/{frame.name}.png", truth)
        metrics = {"psnr": 30.0 + rank, "ssim": 0.9, "psnr_masked": 20.25, "ssim_masked": 0.8125}
        views.append({"name": frame.name, **metrics})
    mean = {"psnr": 34.5, "ssim": 0.9, "psnr_masked": 20.25, "ssim_masked": 0.8125}
    (folder / "evaluation.json").write_text(to_json({"views": views, "mean": mean}))
    log = [
        {"iteration": i, "seconds": i / 10, "loss": 1 / (1 + i), "splats": 7 + i}
        | ({"psnr": 20.0 + i, "ssim": 0.5} if i % 2 == 0 else {})
        for i in range(5)
    ]
    (folder / "training.jsonl").write_text("".join(json.dumps(line) + "\n" for line in log))
    count = 1234
    Gaussians(
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros((count, 4)),
        np.zeros(count),
        np.zeros((count, 1, 3)),
    ).save(folder / "gaussians.npz")
    np.savez(
        folder / "initial_points.npz", points_world=np.zeros((987, 3)), colors=np.zeros((987, 3))
    )
    record = RunLog(
        "reconstruct", {"init": {"voxel_size": 0.004}}, {"initialize": 1.5, "train": 20.25}
    )
    record.save(folder / "run.json")


@pytest.fixture
def run(tmp_path: Path) -> tuple[Capture, Path, Path]:
    """A whole run: (capture, reconstruction folder, where the report belongs)."""
    capture = write_capture(tmp_path / "capture")
    RunLog("simulate", {"mesh": None, "tier": "law"}, {"render": 9.5}).save(
        tmp_path / "capture/run.json"
    )
    write_reconstruction(tmp_path / "reconstruction", capture)
    seconds = {"simulate": 10.0, "reconstruct": 22.0, "export": 0.5}
    RunLog("run", {}, seconds).save(tmp_path / "run.json")
    return capture, tmp_path / "reconstruction", tmp_path / "report.html"


def write_and_parse(run: tuple[Capture, Path, Path]) -> Page:
    write_report(*run)
    return Page(run[2].read_text(encoding="utf-8"))


def decoded(image: dict[str, str | None], folder: Path) -> np.ndarray:
    head, _, data = str(image["src"]).partition(",")
    assert head == "data:image/jpeg;base64"
    path = folder / "decoded.jpg"
    path.write_bytes(base64.b64decode(data, validate=True))
    return read_image(path)


def test_the_page_holds_everything_itself(run: tuple[Capture, Path, Path], tmp_path: Path) -> None:
    page = write_and_parse(run)
    text = run[2].read_text(encoding="utf-8")
    assert all(link.startswith(("data:", "#")) for link in page.links)
    assert "@import" not in text
    assert not re.search(r"url\((?!#)", text)
    assert page.scripts == 0
    for image in page.images:
        assert image["alt"]
        pixels = decoded(image, tmp_path)
        assert pixels.shape == (int(str(image["height"])), int(str(image["width"])), 3)


def test_key_numbers_times_and_settings_are_there(run: tuple[Capture, Path, Path]) -> None:
    text = write_and_parse(run).text
    for expected in (
        *("34.50 dB", "0.9000", "20.25 dB", "0.8125", "1,234", "from 987 points", "4 iterations"),
        *("simulation: render", "9.50", "reconstruction: train", "20.25", "export", "32.5 s"),
        *("init.voxel_size", "0.004", "tier", "law", "warp-lang", "Built-in object"),
    ):
        assert expected in text, expected


def test_contact_sheet_shows_every_kind_of_image_of_six_frames(
    run: tuple[Capture, Path, Path],
) -> None:
    page = write_and_parse(run)
    kinds = ["left", "right", "true depth", "sensed depth", "sensed minus", "object mask"]
    for kind in kinds:
        shown = [
            image for image in page.images if re.search(rf"Frame \d+: {kind}", str(image["alt"]))
        ]
        assert len(shown) == 6, kind
    assert "depth [m]" in page.text
    assert "sensed minus true depth [mm]" in page.text


CHOICE = {
    "effect": "occlusion",
    "on": True,
    "statistic": "occluded_share = 0.09",
    "threshold": "> 0.0001",
    "reason": "near things hide <far> ones",
}


def test_the_sensor_plan_and_the_causes_are_shown(run: tuple[Capture, Path, Path]) -> None:
    before = write_and_parse(run)
    assert "effects of the depth camera" not in before.text
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
    plan = {"depth": [CHOICE], "color": [{**CHOICE, "effect": "shot-noise", "on": False}]}
    (capture.folder / "sensor_plan.json").write_text(json.dumps(plan))
    page = write_and_parse((read_capture(capture.folder), *run[1:]))
    assert "1 of 2 effects of the depth camera" in page.text
    assert all(str(CHOICE[key]) in page.text for key in CHOICE if key != "on")
    assert "occluded 25.0%" in page.text and "ok 75.0%" in page.text
    assert len(page.images) == len(before.images) + 6


def test_poses_scale_and_points_are_shown(run: tuple[Capture, Path, Path]) -> None:
    path = run[1] / "run.json"
    record = json.loads(path.read_text())
    record["results"] |= {
        "sfm": {
            **{"images": 20, "registered": 19, "models": 1, "points": 12345},
            **{"track_length": 5.27, "reprojection_error_px": 0.44, "ray_angle_deg": 11.9},
        },
        "scale": {
            **{"sfm_per_metre": 4.2434, "width": 0.0212, "values": 2664, "modes": 2},
            "warning": "a second mode is near as high",
        },
        "initialization": {
            "sources": {"depth": 51234, "sfm": 77},
            "voxel_size": 0.004,
            "pixels": {"in the mask": 999000},
        },
    }
    path.write_text(json.dumps(record))
    text = write_and_parse(run).text
    for expected in ("19 of 20", "12,345", "0.44 px", "4.2434", "0.50 %", "51,234", "999,000"):
        assert expected in text
    assert "4.00 mm" in text and "second mode" in text


def test_a_broken_sensor_plan_is_named(run: tuple[Capture, Path, Path]) -> None:
    (run[0].folder / "sensor_plan.json").write_text('{"depth": [{}]}')
    with pytest.raises(DigsError, match=r"sensor_plan\.json'.*expected lists"):
        write_and_parse(run)


def test_columns_that_the_capture_lacks_are_left_out(tmp_path: Path) -> None:
    capture = write_capture(tmp_path / "capture", full=False)
    write_reconstruction(tmp_path / "reconstruction", capture)
    page = write_and_parse((capture, tmp_path / "reconstruction", tmp_path / "report.html"))
    alts = " ".join(str(image["alt"]) for image in page.images)
    assert "sensed depth" in alts
    for lacking in ("right image", "true depth"):
        assert lacking not in alts
    assert "Depth error" not in page.text
    assert "simulation" not in page.text


def test_a_colour_only_capture_without_masks_is_fine(tmp_path: Path) -> None:
    capture = write_capture(tmp_path / "capture")
    write_reconstruction(tmp_path / "reconstruction", capture)
    index = json.loads((capture.folder / "transforms.json").read_text())
    for frame in index["frames"]:
        for key in ("depth_file_path", "depth_true_file_path", "mask_path", "right_file_path"):
            del frame[key]
    (capture.folder / "transforms.json").write_text(json.dumps(index))
    capture = read_capture(capture.folder)
    page = write_and_parse((capture, tmp_path / "reconstruction", tmp_path / "report.html"))
    assert {str(i["alt"]).split(": ")[1] for i in page.images if "Frame" in str(i["alt"])} == {
        "left image"
    }
    assert "depth [m]" not in page.text


def test_six_views_are_shown_from_worst_to_best_beside_the_truth(
    run: tuple[Capture, Path, Path], tmp_path: Path
) -> None:
    page = write_and_parse(run)
    shown = [image for image in page.images if str(image["alt"]).startswith("View")]
    names = [str(image["alt"]).split(": ")[0].removeprefix("View ") for image in shown]
    assert names[::3] == names[1::3] == names[2::3]
    # PSNR ascends with the frame in this folder: 10 views, ranks 0, 2, 4, 5, 7, 9.
    assert names[::3] == ["0000", "0004", "0008", "0010", "0014", "0018"]
    truth, rendered, difference = (decoded(image, tmp_path) for image in shown[:3])
    np.testing.assert_array_equal(truth, rendered)
    assert difference.max() <= 8  # nothing differs: the dark end of the colour map
    for frame in run[0].split(TEST_EVERY)[1]:
        assert frame.name in page.text


def test_a_difference_is_where_the_render_is_wrong(
    run: tuple[Capture, Path, Path], tmp_path: Path
) -> None:
    path = run[1] / "renders/0000.png"
    pixels = read_image(path)
    pixels[4:12, 30:40] ^= 0x80
    write_image(path, pixels)
    page = write_and_parse(run)
    alt = "View 0000: absolute difference in colours"
    (image,) = [image for image in page.images if image["alt"] == alt]
    bright = decoded(image, tmp_path).min(axis=2) > 100
    assert bright[5:11, 31:39].all()
    assert not bright[:, :28].any()


def test_same_input_gives_the_same_bytes(run: tuple[Capture, Path, Path]) -> None:
    write_report(*run)
    first = run[2].read_bytes()
    write_report(*run)
    assert run[2].read_bytes() == first


def test_text_from_files_is_escaped(run: tuple[Capture, Path, Path]) -> None:
    evil = "<script>alert('x')</script>&$x_2$"
    record: dict[str, Any] = {evil: evil, "nested": {evil: 1}}
    RunLog("reconstruct", record, {evil: 1.0}).save(run[1] / "run.json")
    RunLog("simulate", {"mesh": f"/x/{evil.replace('/', '')}.glb"}).save(run[0].folder / "run.json")
    page = write_and_parse(run)
    assert page.scripts == 0
    assert page.text.count("alert('x')") >= 5


def test_what_is_not_known_shows_as_a_dash(run: tuple[Capture, Path, Path]) -> None:
    evaluation = json.loads((run[1] / "evaluation.json").read_text())
    evaluation["mean"]["psnr"] = None  # infinite: JSON has no number for it
    evaluation["views"][3]["psnr"] = None
    (run[1] / "evaluation.json").write_text(json.dumps(evaluation))
    (run[1] / "initial_points.npz").unlink()
    text = write_and_parse(run).text
    assert "from – points" in text  # noqa: RUF001


def test_a_run_without_held_out_views_or_training_has_a_report(
    run: tuple[Capture, Path, Path],
) -> None:
    (run[1] / "evaluation.json").write_text('{"views": [], "mean": {}}')
    (run[1] / "training.jsonl").write_text("")
    text = write_and_parse(run).text
    assert "No view was held out." in text
    assert "too few records" in text


def test_own_records_beside_the_report_are_not_counted_twice(
    run: tuple[Capture, Path, Path],
) -> None:
    page = write_and_parse((run[0], run[1], run[1] / "report.html"))
    assert "31.2 seconds in all" in page.text  # 9.5 + 1.5 + 20.25
    assert "whole run" not in page.text


@pytest.mark.parametrize("name", NEEDED)
def test_a_missing_file_is_named(run: tuple[Capture, Path, Path], name: str) -> None:
    (run[1] / name).unlink()
    with pytest.raises(DigsError, match=re.escape(name)):
        write_report(*run)
    assert not run[2].exists()


@pytest.mark.parametrize("name", [*NEEDED, "initial_points.npz"])
def test_a_truncated_file_is_named(run: tuple[Capture, Path, Path], name: str) -> None:
    path = run[1] / name
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(DigsError, match=re.escape(name)):
        write_report(*run)
    assert not run[2].exists()


@pytest.mark.parametrize(
    "content", ["{}", '{"views": [], "mean": 3}', '{"views": [{}], "mean": {}}']
)
def test_an_evaluation_of_another_form_is_named(
    run: tuple[Capture, Path, Path], content: str
) -> None:
    (run[1] / "evaluation.json").write_text(content)
    with pytest.raises(DigsError, match=r"evaluation '.*evaluation\.json'"):
        write_report(*run)


def test_another_capture_or_other_renders_are_refused(run: tuple[Capture, Path, Path]) -> None:
    (run[1] / "renders/0018.png").unlink()
    with pytest.raises(DigsError, match=r"rendered view '.*0018\.png': no such file"):
        write_report(*run)
    write_image(run[1] / "renders/0018.png", np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(
        DigsError, match=r"0018\.png': \(8, 8, 3\) of uint8, expected \(32, 48, 3\)"
    ):
        write_report(*run)
    evaluation = json.loads((run[1] / "evaluation.json").read_text())
    evaluation["views"][0]["name"] = "../../secret"
    (run[1] / "evaluation.json").write_text(json.dumps(evaluation))
    with pytest.raises(DigsError, match=r"names view '\.\./\.\./secret', which capture"):
        write_report(*run)


def test_missing_values_are_grey_and_the_ends_of_a_scale_saturate() -> None:
    scale = ColorScale("x", 1.0, 2.0, "viridis")
    colors = scale.paint(np.array([[np.nan, 0.0, 1.0, 2.0, 99.0]]))[0]
    assert colors[0].tolist() == [128, 128, 128]
    assert colors[1].tolist() == colors[2].tolist() == [68, 1, 84]  # viridis begins in dark violet
    assert colors[3].tolist() == colors[4].tolist() == [253, 231, 37]  # and ends in yellow
    assert scale.gradient(2) == ["rgb(68 1 84)", "rgb(253 231 37)"]


@pytest.mark.parametrize(
    "values", [np.zeros(0), np.full(5, np.nan), np.full(5, 1.25), np.array([0.5, 1.0, np.nan])]
)
def test_scales_of_any_values_have_a_range(values: np.ndarray) -> None:
    depths, errors = depth_scale(values), error_scale(values)
    assert 0 <= depths.low < depths.high
    assert errors.low == -errors.high < 0


def test_shrinking_keeps_the_mean_and_small_images() -> None:
    image = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    small = shrink(image, 20)
    assert small.shape == (13, 20, 3)
    np.testing.assert_allclose(small.mean(), image[:39, :60].mean(), atol=0.5)
    assert shrink(image, 60) is image
    assert shrink(image[:1], 20).shape == (1, 60, 3)


def test_the_object_stands_on_white() -> None:
    image = np.full((1, 3, 3), 100, dtype=np.uint8)
    found = over_white(image, np.array([[0, 255, 128]], dtype=np.uint8))
    assert found[0, :, 0].tolist() == [255, 100, round(100 * 128 / 255 + 127)]
    assert over_white(image, None) is image
