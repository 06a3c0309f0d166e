"""A recording and its reconstruction as files, small, and a reader of the report's page."""

import base64
import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import read_image, write_image
from digs_warp.data.rig import Rig
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.files import to_json
from digs_warp.record.run_log import RunLog
from digs_warp.show.report.page import write_report
from digs_warp.show.report.pictures import over_white

WIDTH, HEIGHT, FRAMES, TEST_EVERY = 48, 32, 20, 2
VOID_TAGS = {"meta", "img", "br", "link", "input"}


class Page(HTMLParser):
    """Collects what a page holds, and checks that its tags nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.images: list[dict[str, str | None]] = []
        self.links: list[str] = []
        self.text = ""
        self.scripts: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag == "img":
            self.images.append(values)
        if tag == "script":
            self.scripts.append("")
        outside = [values.get(key) for key in ("src", "href", "action")]
        self.links += [link for link in outside if link]
        if tag not in VOID_TAGS:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] == "script":
            self.scripts[-1] += data
        elif self._open and self._open[-1] != "style":
            self.text += data + " "


def write_capture(folder: Path) -> Capture:
    """A disc on noise: a stereo recording with true depth."""
    rng = np.random.default_rng(0)
    writer = CaptureWriter(folder, Intrinsics.from_fov(WIDTH, HEIGHT, 60), Rig(0.1))
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    mask = ((rows - 16) ** 2 + (columns - 24) ** 2 < 100).astype(np.uint8) * 255
    for number in range(FRAMES):
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        depth_true = np.where(mask > 0, 1.0 + 0.01 * rows, 4.0).astype(np.float32)
        depth = depth_true + rng.normal(0, 0.002, depth_true.shape).astype(np.float32)
        depth[:, :5] = np.nan
        right = image[:, ::-1]
        images = FrameImages(image, depth, mask, right=right, depth_true=depth_true)
        writer.write_frame(number, images)
        eye = np.array([np.cos(number), np.sin(number), 0.3])
        writer.add_pose(number, look_at(eye, np.zeros(3), np.array([0.0, 0, 1])), number / 4)
    return writer.finish()


def write_reconstruction(folder: Path, capture: Capture) -> None:
    _, test = capture.split(TEST_EVERY)
    whole = {"ssim_object": 0.9, "psnr_frame": 20.25, "ssim_frame": 0.8125}
    views = []
    for rank, frame in enumerate(test):
        truth = over_white(frame.load_image(), frame.load_mask())
        write_image(folder / f"renders/{frame.name}.png", truth)
        views.append({"name": frame.name, **whole, "psnr_object": 30.0 + rank})
    mean = whole | {"psnr_object": 34.5}
    (folder / "evaluation.json").write_text(to_json({"views": views, "mean": mean}))
    log = [
        {"iteration": i, "seconds": i / 10, "loss": 1 / (1 + i), "splats": 7 + i}
        | ({"psnr_frame": 20.0 + i, "ssim_frame": 0.5, "adherence": 0.0025} if i % 2 == 0 else {})
        for i in range(5)
    ]
    (folder / "training.jsonl").write_text("".join(json.dumps(line) + "\n" for line in log))
    shapes = ((1234, 3), (1234, 3), (1234, 4), 1234, (1234, 1, 3))
    Gaussians(*map(np.zeros, shapes)).save(folder / "gaussians.npz")
    np.savez(
        folder / "initial_points.npz", points_world=np.zeros((987, 3)), colors=np.zeros((987, 3))
    )
    record = RunLog(
        "reconstruct", {"init": {"voxel_size": 0.004}}, {"initialize": 1.5, "train": 20.25}
    )
    surface = {"accuracy": 0.00125, "completeness": 0.00375, "seen_completeness": 0.00155}
    record.results |= {"training": {"adherence": 0.0025}, "scores": {"surface": surface}}
    record.results["capture"] = str(capture.folder)
    record.save(folder / "run.json")


def report_on(run: tuple[Capture, Path, Path]) -> None:
    """Write the report of a run: capture, folder of the reconstruction, where the page goes."""
    capture, folder, page = run
    write_report(capture, Reconstruction.load(folder, capture), page)


def write_and_parse(run: tuple[Capture, Path, Path]) -> Page:
    report_on(run)
    return Page(run[2].read_text(encoding="utf-8"))


def decoded(image: dict[str, str | None], folder: Path) -> np.ndarray:
    head, _, data = str(image["src"]).partition(",")
    assert head == "data:image/jpeg;base64"
    path = folder / "decoded.jpg"
    path.write_bytes(base64.b64decode(data, validate=True))
    return read_image(path)
